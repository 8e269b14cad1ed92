# SPDX-License-Identifier: Apache-2.0
"""Lines of a plain, gzip or xz text file, and the numbers in them.

Whatever is wrong with a file is a ``LogFormatError``. What reads a word of it raises ``ValueError``
with the field, the value and what was expected; ``about`` adds the file and the line.
"""

import gzip
import lzma
import math
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Decimal
from pathlib import Path
from typing import BinaryIO, cast

from slam import inputs
from slam.errors import LogFormatError, MissingPathError
from slam.frames import NS_PER_S
from slam.logs.repairs import TORN_LINE, Repairs
from slam.logs.unpacking import MAX_TEXT_BYTES, open_xz

# of bytes that may say anything; ``InvalidValueError`` is a ``ValueError``
IMPOSSIBLE = (ValueError, ArithmeticError, LookupError, AttributeError, TypeError)
MAX_BEAMS = 20_000
MAX_RANGE_M = 1e4
MAX_COORDINATE = 1e6
MAX_STAMP_S = 9e9  # what 64-bit nanoseconds hold: year 2255
MAX_LINE_BYTES = 1 << 20  # a 20 000 beam scan needs a fifth of it
_NO_END = "last line has no end: the file is truncated"
_GZIP, _XZ = b"\x1f\x8b", b"\xfd7zXZ\x00"
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")

Pose = tuple[float, float, float]


@contextmanager
def about(path: Path, what: str = "", line: int | None = None) -> Iterator[None]:
    """Values that no type takes end as ``LogFormatError``: file, line, ``what``, field, value."""
    try:
        yield
    except IMPOSSIBLE as error:
        raise LogFormatError(path, f"{what}: {error}" if what else str(error), line) from error


def number(word: str, field: str, limit: float = MAX_COORDINATE) -> float:
    """A finite number within +-limit; ``field`` is what it is for whoever reads the error."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= limit:  # false for NaN too
        raise ValueError(f"{field}: expected a number within +-{limit:g}, got {word[:40]!r}")
    return value


def pose_of(words: list[str], whose: str) -> Pose:
    """x, y, theta of the robot or of its laser."""
    x, y, theta = (
        number(word, f"{name} of the {whose}")
        for word, name in zip(words, ("x", "y", "theta"), strict=True)
    )
    return x, y, theta


def stamp_ns(word: str) -> int:
    """Exact nanoseconds (``float`` would lose the last digits of Unix times); may be negative."""
    number(word, "time", MAX_STAMP_S)
    try:
        return round(Decimal(word) * NS_PER_S)
    except ArithmeticError as error:  # an exponent of twenty digits
        raise ValueError(f"time: expected a number, got {word[:40]!r}") from error


def range_of(word: str, k: int) -> float:
    """Range ``k`` of a scan, m."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= MAX_RANGE_M:  # false for NaN too
        raise ValueError(f"range {k} must be 0 to {MAX_RANGE_M:g} m, got {word[:40]!r}")
    return value


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
            raise MissingPathError(path, "no such file")
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


def words_of(path: Path, repairs: Repairs | None = None) -> Iterator[tuple[int, list[str]]]:
    """``numbered_lines`` split at blanks, without empty lines and those that begin with ``#``."""
    for number, line in numbered_lines(path, repairs):
        words = line.split()
        if words and not words[0].startswith("#"):
            yield number, words


def _open(path: Path) -> BinaryIO:
    inputs.note(path)
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
        line = raw.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise LogFormatError(path, "not a text file", number) from error
    if _CONTROL.search(line):
        raise LogFormatError(path, "not a text file", number)
    return line
