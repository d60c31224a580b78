"""Files that grow record by record: what was written stays, whatever ends the process."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from actionopt.tools.files import ready, whole

HEAD = struct.Struct("<QI")  # of a record: its length and its checksum


class Journal:
    """A file of records, each a mapping of names to arrays; begun, or gone on with.

    A line of JSON says what it is about; behind it each record has its length and checksum. One
    that was cut short, as by a process that was killed, is dropped when the file is opened again.

    Parameters
    ----------
    file : str or path
    about : mapping of str to plain data
        What the records belong to. `about["format"]` is the kind of file.

    Attributes
    ----------
    records : list of dict
        What was in the file.

    Raises
    ------
    ValueError
        If there is a file that is about something else: what differs is named.
    OSError
        If it cannot be read or written.
    """

    def __init__(self, file: str | Path, about: Mapping[str, Any]) -> None:
        self.file = ready(file)
        self.records: list[dict[str, np.ndarray]] = []
        if self.file.exists():
            self._read(dict(about))
        else:
            with whole(self.file) as part:
                part.write_bytes(json.dumps(about).encode() + b"\n")

    def append(self, record: Mapping[str, Any]) -> None:
        """Write a record; once this returns it stays."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **record)
        data = stream.getvalue()
        with open(self.file, "ab") as file:
            size = file.tell()
            try:
                file.write(HEAD.pack(len(data), zlib.crc32(data)) + data)
                file.flush()
                os.fsync(file.fileno())
            except BaseException:  # behind half a record none would be read again
                file.truncate(size)
                raise

    def _read(self, about: dict[str, Any]) -> None:
        """Read what there is, and cut off what is not whole."""
        with open(self.file, "r+b") as file:
            self._check(file.readline(), about)
            good, size = file.tell(), os.fstat(file.fileno()).st_size
            while len(head := file.read(HEAD.size)) == HEAD.size:
                length, checksum = HEAD.unpack(head)
                data = file.read(length) if length <= size - file.tell() else b""
                if len(data) < length or zlib.crc32(data) != checksum:
                    break
                with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
                    self.records.append({name: arrays[name] for name in arrays.files})
                good = file.tell()
            file.truncate(good)

    def _check(self, line: bytes, about: dict[str, Any]) -> None:
        """Raise ValueError if the first line says that it is about something else."""
        try:
            found = json.loads(line)
            same_kind = found["format"] == about["format"]
        except (ValueError, TypeError, KeyError):
            same_kind = False
        if not same_kind:
            raise ValueError(
                f"expected a file of the kind {about['format']!r}, found {str(self.file)!r}, which "
                "is something else; give the name of a new file"
            )
        wanted = json.loads(json.dumps(about))
        for name in wanted:
            if found.get(name) != wanted[name]:
                raise ValueError(
                    f"expected a file of the same question, found {str(self.file)!r}, whose {name} "
                    f"is {_short(found.get(name))}, not {_short(wanted[name])}; give another file, "
                    "or delete this one to begin anew"
                )


def _short(value: Any) -> str:
    """Return what a value is, in few words."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:28]} ... {text[-28:]}"
