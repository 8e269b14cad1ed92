# SPDX-License-Identifier: Apache-2.0
"""Writing so that nothing half-written is ever seen: a temporary name first, renamed when whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from slam.errors import OutputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it onto ``path`` when the block succeeds.

    On any exception, Ctrl-C included, the temporary file and the folders made for it are removed
    and ``path`` stays as it was. The suffix of ``path`` is kept, because writers choose formats by
    it. Raises ``OutputError`` when it cannot be written.
    """
    if not path.name:
        raise OutputError(f"cannot write {path}: not a file name")
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    made: list[Path] = []
    done = False
    try:
        made = [folder for folder in path.parents if not folder.exists()]  # innermost first
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch()
        yield temporary
        os.replace(temporary, path)
        done = True
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if not done:
            _remove(temporary, made)


def _remove(temporary: Path, folders: list[Path]) -> None:
    with suppress(OSError):
        temporary.unlink()
    for folder in folders:
        with suppress(OSError):  # something else may have been put there
            folder.rmdir()


def write_bytes(path: Path, data: bytes) -> None:
    """``path.write_bytes`` that appears whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """``path.write_text`` in UTF-8 that appears whole or not at all."""
    write_bytes(path, text.encode("utf-8"))
