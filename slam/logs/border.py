# SPDX-License-Identifier: Apache-2.0
"""Where what a file says becomes frames: whatever cannot be is the file's fault."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slam.errors import LogFormatError

# of bytes that may say anything; ``InvalidValueError`` is a ``ValueError``
IMPOSSIBLE = (ValueError, ArithmeticError, LookupError, AttributeError, TypeError)


@contextmanager
def about(path: Path, what: str = "", line: int | None = None) -> Iterator[None]:
    """Values that no type takes end as ``LogFormatError``: file, line, ``what``, field, value."""
    try:
        yield
    except IMPOSSIBLE as error:
        raise LogFormatError(path, f"{what}: {error}" if what else str(error), line) from error
