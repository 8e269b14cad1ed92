# SPDX-License-Identifier: Apache-2.0
"""What a command reads, so that it never writes over it.

A verb notes what it is given, a reader what is named in there: the image of a map, the files of a
bag. Whatever writes asks first (``slam.files``). Outside of a command nothing is noted.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from slam.errors import OutputError

_read: set[tuple[int, int]] | None = None  # device and number of each file and folder


@contextmanager
def of_one_command() -> Iterator[None]:
    """What is noted in here counts until the end of the block."""
    global _read
    before, _read = _read, set()
    try:
        yield
    finally:
        _read = before


def note(*paths: Path) -> None:
    """These are read; one that is not there is none."""
    if _read is not None:
        for path in paths:
            _read.update(_identity(path))


def release(path: Path) -> None:
    """This may be written over after all: whoever gave it wants that."""
    if _read is not None:
        _read.difference_update(_identity(path))


def refuse(*paths: Path) -> None:
    """``OutputError`` for one that is read."""
    for path in paths if _read else ():
        if not _identity(path).isdisjoint(_read or ()):
            raise OutputError(f"{path} is what this command reads: write to another place")


def _identity(path: Path) -> set[tuple[int, int]]:
    with suppress(OSError, ValueError):  # the latter: a null byte in the name
        there = os.stat(path)
        return {(there.st_dev, there.st_ino)}
    return set()
