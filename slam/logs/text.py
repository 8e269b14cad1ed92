# SPDX-License-Identifier: Apache-2.0
"""Lines of a plain, gzip or xz text file; whatever is wrong is a ``LogFormatError``."""

from __future__ import annotations

import gzip
import lzma
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, cast

from slam.errors import LogFormatError
from slam.logs.repairs import TORN_LINE, Repairs
from slam.logs.unpacking import MAX_TEXT_BYTES, open_xz

MAX_LINE_BYTES = 1 << 20  # a 20 000 beam scan needs a fifth of it
_NO_END = "last line has no end: the file is truncated"
_GZIP, _XZ = b"\x1f\x8b", b"\xfd7zXZ\x00"
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")


def numbered_lines(path: Path, repairs: Repairs | None = None) -> Iterator[tuple[int, str]]:
    """(line number from 1, line without its newline) of a .log, .log.gz or .log.xz.

    Raises ``LogFormatError`` that names file and line when the file is missing, no regular file,
    empty, unreadable, corrupt, binary, or does not end with a newline: every logger ends its lines,
    so a file that stops inside one was cut off. So it does beyond ``MAX_TEXT_BYTES``.

    With ``repairs``, a last line without an end is left out and counted there, whatever is in it:
    half a number is a number, too. A file of one such line is none.
    """
    number, total = 0, 0
    try:
        if not path.exists():
            raise LogFormatError(path, "no such file")
        if not path.is_file():  # a pipe or device might never end
            raise LogFormatError(path, "is not a regular file")
        with _open(path) as file:
            while raw := file.readline(MAX_LINE_BYTES):
                number += 1
                total += len(raw)
                if repairs is not None and number > 1 and _torn(raw):
                    repairs.note(TORN_LINE, _NO_END, number)
                    return
                if total > MAX_TEXT_BYTES:
                    raise LogFormatError(
                        path, f"unpacks to more than {MAX_TEXT_BYTES} bytes", number
                    )
                yield number, _text(path, number, raw)
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise LogFormatError(path, f"corrupt or truncated file: {error}", number + 1) from error
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    if number == 0:
        raise LogFormatError(path, "is empty")


def _open(path: Path) -> BinaryIO:
    with path.open("rb") as file:
        magic = file.read(len(_XZ))
    if magic.startswith(_GZIP) or (magic and path.suffix == ".gz"):
        return cast(BinaryIO, gzip.open(path, "rb"))
    if magic.startswith(_XZ) or (magic and path.suffix == ".xz"):
        return open_xz(path)
    return path.open("rb")


def _torn(raw: bytes) -> bool:
    return not raw.endswith(b"\n") and len(raw) < MAX_LINE_BYTES


def _text(path: Path, number: int, raw: bytes) -> str:
    if not raw.endswith(b"\n"):
        if len(raw) >= MAX_LINE_BYTES:
            raise LogFormatError(path, f"line longer than {MAX_LINE_BYTES} bytes: no log", number)
        raise LogFormatError(path, _NO_END, number)
    try:
        line = raw.decode("utf-8").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise LogFormatError(path, "not a text file", number) from error
    if _CONTROL.search(line):
        raise LogFormatError(path, "not a text file", number)
    return line
