"""Write files whole or not at all."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


def ready(file: str | Path, *endings: str) -> Path:
    """Return where `file` is to be written.

    Raises FileNotFoundError if its folder is missing, ValueError if it is no name of a file, or has
    none of the endings.
    """
    if not isinstance(file, (str, os.PathLike)) or not str(file):
        raise ValueError(f"expected the name of a file, found {file!r}")
    target = Path(file)
    if not target.parent.is_dir():
        raise FileNotFoundError(
            f"expected a folder that is there to write {str(target)!r} in, found none; make it, or "
            "correct the name"
        )
    if target.is_dir():
        raise ValueError(f"expected the name of a file, found the folder {str(target)!r}")
    if endings and target.suffix.lower() not in endings:
        found = f"{target.name!r}" + ("" if target.suffix else ", which has no ending")
        raise ValueError(f"expected a file that ends in {', '.join(endings)}, found {found}")
    return target


@contextmanager
def whole(file: str | Path) -> Iterator[Path]:
    """Yield a path beside `file`, of the same ending; what is written there takes its place.

    If anything is raised meanwhile, a file that was there stays as it was. It keeps its mode, and
    where `file` is a symbolic link, the link stays and what it leads to is replaced.

    Raises FileNotFoundError, before anything is written, if the folder is missing.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     with whole(f"{folder}/page.txt") as part:
    ...         _ = part.write_text("done")
    ...     [f.name for f in Path(folder).iterdir()]
    ['page.txt']
    """
    target = ready(file)
    ending = target.suffix  # what is written goes by the name that was given
    if target.is_symlink():
        target = ready(os.path.realpath(target))
    part = target.with_name(f".{target.stem}.{os.getpid()}.partial{ending}")
    try:
        yield part
        with suppress(FileNotFoundError):
            part.chmod(stat.S_IMODE(target.stat().st_mode))
        os.replace(part, target)
    except OSError as error:
        if error.filename == str(part):  # a name that nobody gave
            raise type(error)(error.errno, error.strerror, str(target)) from None
        raise
    finally:
        part.unlink(missing_ok=True)


def write(file: str | Path, content: str | bytes) -> None:
    """Write a file of text or bytes, whole or not at all, and make the folder it belongs in."""
    target = Path(file)
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole(target) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def rounded(value: Any, digits: int = 6) -> Any:
    """Return plain data with its numbers rounded to significant digits.

    >>> rounded({"time": 0.123456789, "count": 3, "setting": [1e-9, None]})
    {'time': 0.123457, 'count': 3, 'setting': [1e-09, None]}
    """
    if isinstance(value, dict):
        return {k: rounded(v, digits) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v, digits) for v in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
