# SPDX-License-Identifier: Apache-2.0
"""SHA256SUMS: what ``sha256sum -c`` reads, for a folder and all that lies in it.

It is written last. A changed byte in it is a hash that does not fit, a lost line an unlisted file,
one line more a missing file; it is read strictly, so that blanks, case and order count as well. A
file that is made alone has its hash beside it instead, as ``<name>.sha256``.
"""

import hashlib
import os
import re
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Literal, NoReturn

from slam import bounded, locks
from slam.errors import LogFormatError, printable
from slam.files import write_text

SUMS = "SHA256SUMS"
BESIDE = ".sha256"
PART = ".part"  # in names of what is being written
MAX_BYTES = 1 << 28  # of a SHA256SUMS: two million files
_LINE = re.compile(r"([0-9a-f]{64})  (\S.*)")
Kind = Literal["damaged", "incomplete", "foreign", "same messages"]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One thing that is not as it was: ``name`` of the file within its folder, and ``why``."""

    kind: Kind
    name: str
    why: str


def sha256(path: Path) -> str:
    """Of a file, read in pieces; ``LogFormatError`` when it cannot be read."""
    bounded.check_file(path)
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error


def text_of(sums: Mapping[str, str]) -> str:
    """The one way in which these hashes are written."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items()))


def write_sums(folder: Path, ours: Sequence[str] = ("*",), *, over: Path | None = None) -> None:
    """Of every file in the folder and below but hidden ones, by relative name.

    ours  patterns of the names that are listed; whatever else lies there stays foreign
    over  folder into which all that lies here will be moved; what stays there is listed too

    One with its hash beside it gets that hash: it may have been damaged since.
    """
    found = {name: place for place in (over, folder) if place for name in tree(place)[0]}
    shown = {
        name: _digest(place / name)
        for name, place in found.items()
        if name != SUMS
        and not _hidden(name)
        and name.isprintable()
        and any(fnmatchcase(name, pattern) for pattern in ours)
    }
    write_text(folder / SUMS, text_of(shown))


def add_to_sums(path: Path) -> None:
    """List a file again in its folder's SHA256SUMS, where there is one."""
    if (path.parent / SUMS).exists():
        sums = read_sums(path.parent) | {path.name: sha256(path)}
        write_text(path.parent / SUMS, text_of(sums))


def read_sums(folder: Path) -> dict[str, str]:
    """File name -> hash; ``LogFormatError`` for a file that is missing or something else."""
    return _read(folder / SUMS)


def _read(path: Path) -> dict[str, str]:
    text = bounded.text_of(path, MAX_BYTES)
    lines, sums = text.split("\n"), dict[str, str]()
    for number, line in enumerate(lines[:-1] if lines[-1] == "" else lines, 1):
        found = _LINE.fullmatch(line)
        if found is None or not _is_inside(found[2]):
            raise LogFormatError(path, f"no hash and file name: {line[:80]!r}", number)
        sums[found[2]] = found[1]
    if not sums:
        raise LogFormatError(path, "lists no file")
    if text != text_of(sums):
        raise LogFormatError(path, "damaged: not as it was written (order, repetition, last line)")
    return sums


def _is_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return name.isprintable() and not path.is_absolute() and ".." not in path.parts


def write_beside(path: Path, content: Path) -> None:
    """``<name>.sha256`` of what lies in ``content`` and will be called ``path``."""
    write_text(_beside(path), text_of({path.name: sha256(content)}))


def _beside(path: Path) -> Path:
    return path.with_name(path.name + BESIDE)


def damage_beside(path: Path) -> str:
    """What is wrong with a file by the hash beside it; "" where all is well."""
    if not _beside(path).exists():
        return f"{path} has no hash beside it: no {_beside(path).name}"
    try:
        wanted = _read(_beside(path))
        if list(wanted) != [path.name]:
            return f"{_beside(path)} is damaged: not of {path.name}"
        if sha256(path) != wanted[path.name]:
            return f"{path} is damaged: its hash is not that of {_beside(path).name}"
    except LogFormatError as error:
        return str(error)
    return ""


def _digest(path: Path) -> str:
    try:
        return _read(_beside(path))[path.name]
    except (LogFormatError, KeyError):
        return sha256(path)


def tree(folder: Path, *, results: bool = True) -> tuple[set[str], set[str]]:
    """Names of all files in the folder and below, and of what is neither file nor folder.

    results  whether a folder right in it that has a SHA256SUMS is another result and left out

    Links are such, and not followed; so are empty folders. Raises ``LogFormatError`` for one that
    cannot be read.
    """
    files, others = set(), set()
    for here, folders, names in os.walk(folder, onerror=_unreadable):
        if results and os.path.dirname(here) == os.fspath(folder) and SUMS in names:
            folders.clear()
            continue
        above = Path(here).relative_to(folder)
        for name in (*folders, *names):
            inner = (above / name).as_posix()
            try:
                mode = os.lstat(os.path.join(here, name)).st_mode
            except OSError as error:  # gone meanwhile
                _unreadable(error)
            if stat.S_ISREG(mode):
                files.add(inner)
            elif not stat.S_ISDIR(mode):
                others.add(inner)
        if not folders and not names and here != os.fspath(folder):
            others.add(above.as_posix())
    return files, others


def _unreadable(error: OSError) -> NoReturn:
    raise LogFormatError(error.filename, f"cannot be read: {error.strerror}") from error


def faults(folder: Path, listed: Mapping[str, str], *, results: bool = True) -> list[Fault]:
    """What is wrong with a folder by the hashes that its SHA256SUMS lists, links unfollowed.

    results  as of ``tree``
    """
    files, others = tree(folder, results=results)
    found = []
    for name, wanted in listed.items():
        path = folder / name
        if name not in files:
            found.append(Fault(kind="incomplete", name=name, why=f"{path} is missing"))
        elif sha256(path) != wanted:
            why = f"{path} is damaged: its hash is not that of {SUMS}"
            found.append(Fault(kind="damaged", name=name, why=why))
    return found + foreign(folder, (files | others) - {SUMS}, set(listed))


def foreign(folder: Path, there: set[str], known: set[str]) -> list[Fault]:
    """Of the names ``there`` those not ``known``; a folder that holds nothing known is one."""
    ours = {".", *(above for name in known for above in _above(name))}
    # of each the outermost folder above it with nothing of ours, or itself
    tops = {
        next((above for above in reversed(_above(name)) if above not in ours), name)
        for name in there - known
    }
    return [Fault(kind="foreign", name=top, why=_stranger(folder, top)) for top in sorted(tops)]


def _above(name: str) -> list[str]:
    return [above.as_posix() for above in PurePosixPath(name).parents]


def _stranger(folder: Path, name: str) -> str:
    shown = printable(name)
    last = PurePosixPath(name).name
    if last in locks.NAMES or last.startswith(".tables.") or (last[0] == "." and PART in last):
        return f"{folder}/{shown} is left of a run that was killed, or is being written"
    if (folder / name).is_symlink():
        return f"{folder}/{shown} is a link, which no run leaves and nothing vouches for"
    return f"{folder}/{shown} is foreign: not listed in {SUMS}"


def _hidden(name: str) -> bool:
    return any(part.startswith(".") for part in PurePosixPath(name).parts)


def check_vouched(path: Path) -> None:
    """Raise ``LogFormatError`` when a SHA256SUMS in the folder of ``path``, or in the one above,
    lists it with another hash. A file that none lists passes, unless the one beside it lists
    something that is not there: that may be its own line, with a damaged name."""
    listed, lost = False, ""
    for folder in (path.parent, path.parent.parent):
        if not (folder / SUMS).is_file():
            continue
        sums = read_sums(folder)
        wanted = sums.get(path.relative_to(folder).as_posix())
        if wanted is not None and sha256(path) != wanted:
            raise LogFormatError(path, f"damaged: its hash is not that of {folder / SUMS}")
        listed = listed or wanted is not None
        if folder == path.parent and not listed:
            lost = next((name for name in sums if not os.path.lexists(folder / name)), "")
    if lost and not listed and path.exists():
        raise LogFormatError(
            path.parent / SUMS, f"damaged: it lists {lost}, which is not there, and not {path.name}"
        )
