# SPDX-License-Identifier: Apache-2.0
"""SHA256SUMS: what ``sha256sum -c`` reads, for a folder and all that lies in it."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from slam.errors import LogFormatError
from slam.files import write_text

SUMS = "SHA256SUMS"
_LINE = re.compile(r"([0-9a-f]{64})  (\S.*)")


def sha256(path: Path) -> str:
    """Of a file, read in pieces; ``LogFormatError`` when it cannot be read."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


def write_sums(folder: Path) -> None:
    """Of every file in the folder but hidden ones, by relative name."""
    names = sorted(p.relative_to(folder).as_posix() for p in folder.iterdir() if _counts(p))
    write_text(folder / SUMS, "".join(f"{sha256(folder / name)}  {name}\n" for name in names))


def _counts(path: Path) -> bool:
    return path.is_file() and path.name != SUMS and not path.name.startswith(".")


def read_sums(folder: Path) -> dict[str, str]:
    """File name -> hash; ``LogFormatError`` for a file that is missing or something else."""
    path = folder / SUMS
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise LogFormatError(path, "not a list of hashes") from error
    sums: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        found = _LINE.fullmatch(line)
        if found is None or ".." in Path(found[2]).parts or Path(found[2]).is_absolute():
            raise LogFormatError(path, f"no hash and file name: {line[:80]!r}", number)
        sums[found[2]] = found[1]
    if not sums:
        raise LogFormatError(path, "lists no file")
    return sums


def damage(folder: Path) -> dict[str, str]:
    """File name -> what is wrong with it, by the folder's SHA256SUMS; empty where all is well."""
    wrong = {}
    for name, wanted in read_sums(folder).items():
        path = folder / name
        if not path.is_file():
            wrong[name] = f"{path} is missing"
        elif sha256(path) != wanted:
            wrong[name] = f"{path} is damaged: its hash is not that of {SUMS}"
    return wrong
