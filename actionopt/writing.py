"""Write files whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(file: str | Path) -> Iterator[Path]:
    """Yield a path beside `file`, of the same ending; what is written there takes its place.

    If anything is raised meanwhile, a file that was there stays as it was.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     with whole(f"{folder}/page.txt") as part:
    ...         _ = part.write_text("done")
    ...     [f.name for f in Path(folder).iterdir()]
    ['page.txt']
    """
    target = Path(file)
    part = target.with_name(f".{target.stem}.{os.getpid()}.partial{target.suffix}")
    try:
        yield part
        os.replace(part, target)
    except OSError as error:
        if error.filename == str(part):  # a name that nobody gave
            raise type(error)(error.errno, error.strerror, str(target)) from None
        raise
    finally:
        part.unlink(missing_ok=True)
