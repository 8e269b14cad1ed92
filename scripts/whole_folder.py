# SPDX-License-Identifier: Apache-2.0
"""Results that appear whole or not at all, and take the place of earlier ones of ours alone."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scripts.console import note
from scripts.output import another, plain, told, words_of_ours
from sim.recording.sums import SUMS, read_sums, tree, write_sums
from slam import files, inputs
from slam.errors import InvalidValueError, LogFormatError, OutputError

OLD = ".old"  # of the earlier run, while a new one takes its place; of what bears a new one's name
MOST_TOLD = 5  # names in one line


@contextmanager
def whole_folder(
    path: Path, *, overwrite: bool, command: str = "", settings: Mapping[str, Any] | None = None
) -> Iterator[Path]:
    """Yield a temporary folder beside ``path``; it takes the name ``path`` when the block succeeds.

    command, settings  as ``write_recipe`` gets them: only for a folder whose recipe has the same
                       does the error name --overwrite as a way out

    Of an earlier result, what its SHA256SUMS lists is replaced. The rest stays, and is told in one
    line; a file of a name that the new result has, too, then ends in ``.old``.

    Raises ``OutputError`` when ``path`` exists and ``overwrite`` is off, when it exists and holds
    no recipe of ours (then it is somebody else's and never replaced), or something that the same
    command reads, or cannot be written. On any failure, Ctrl-C included, the temporary folder is
    removed and an earlier run stays as it was. What killed runs left is removed first. After a
    power cut the new or the earlier run is there (where the file system cannot swap two names, the
    earlier one perhaps as .NAME.PID.old).
    """
    said, path = path, path.absolute()
    temporary = path.with_name(f".{path.name}.{os.getpid()}{files.PART}")
    made: list[Path] = []
    try:
        with told(said, temporary):
            made = files.make_folder(path.parent)
            listed = replaceable(path, overwrite, command, settings or {})
            files.clear_parts(path)
            temporary.mkdir()
            with files.locked(temporary):
                yield temporary
                write_sums(temporary)
                inputs.refuse(path, *(path / name for name in listed))  # noted since it began
                kept = _keep(path, temporary, listed)
                _take_place(temporary, path)
        if kept:
            more = ", ..." if len(kept) > MOST_TOLD else ""
            note(f"{said}: kept what mobilia did not write: {', '.join(kept[:MOST_TOLD])}{more}")
    finally:
        files.remove(temporary)
        files.remove_empty(made)


def check_place(*places: Path, overwrite: bool) -> None:
    """Files of one result may be written: ``OutputError`` where one is read by the same command,
    ``InvalidValueError`` where some are there already, unless they may be replaced.
    """
    inputs.refuse(*places)
    there = [str(place) for place in places if os.path.lexists(place)]
    if there and not overwrite:
        raise InvalidValueError(f"there already: {', '.join(there)}: --overwrite replaces them")


def replaceable(path: Path, overwrite: bool, command: str, settings: Mapping[str, Any]) -> Set[str]:
    """The files of an earlier result at ``path``, by its SHA256SUMS; itself among them.

    Raises as ``whole_folder``, which asks it, too: a verb may before it says what is ahead.
    """
    if not path.exists():
        return frozenset()
    if not path.is_dir():
        raise OutputError(f"{path} is a file; --out needs a folder")
    if not any(path.iterdir()):
        return frozenset()
    words = words_of_ours(path)
    if not overwrite:
        raise OutputError(_what_lies_there(path, words, command, settings))
    try:
        listed = {SUMS, *read_sums(path)}
    except LogFormatError as error:
        raise OutputError(
            f"{path} does not say which of its files are ours: choose another --out ({error})"
        ) from error
    inputs.refuse(path, *(path / name for name in listed))
    return listed


def _what_lies_there(
    path: Path, words: Mapping[str, Any], command: str, settings: Mapping[str, Any]
) -> str:
    """What the folder of ours at ``path`` holds, and what to do about it."""
    if words["command"] != command:
        return another(path, words)
    there, ours = words["settings"], json.loads(json.dumps(plain(settings)))
    if there == ours:
        return (
            f"{path} holds an earlier run of the same settings: pass --overwrite to replace it, "
            "or another --out"
        )
    keys = sorted(key for key in {*there, *ours} if there.get(key) != ours.get(key))
    differ = ", ".join(f"{key} {there.get(key)!r:.40} there, {ours.get(key)!r:.40} now"
                       for key in keys[:3])  # fmt: skip
    return f"{path} holds another run ({differ}): choose another --out"


def _keep(path: Path, temporary: Path, listed: Set[str]) -> list[str]:
    """Give the new folder what else the earlier one holds, by which names; both have it then."""
    if not path.is_dir():
        return []
    kept = []
    for name in sorted(set().union(*tree(path, results=False)) - listed):
        *above, last = Path(name).parts
        folder = temporary
        for part in above:  # a folder of theirs may bear the name of a file of ours, too
            folder = folder / part
            while os.path.lexists(folder) and (folder.is_symlink() or not folder.is_dir()):
                folder = folder.with_name(folder.name + OLD)
        place = folder / last
        while os.path.lexists(place):
            place = place.with_name(place.name + OLD)
        files.make_folder(place.parent)
        if (path / name).is_dir() and not (path / name).is_symlink():
            place.mkdir()  # an empty one
        else:
            _double(path / name, place)
        kept.append(place.relative_to(temporary).as_posix())
    return kept


def _double(file: Path, place: Path) -> None:
    """A second name of it, or a copy where a disk has no second names."""
    try:
        os.link(file, place, follow_symlinks=False)
    except OSError:
        shutil.copy2(file, place, follow_symlinks=False)


def _take_place(temporary: Path, path: Path) -> None:
    """Move the new folder in and the old one out, at once where the system can do that."""
    if not path.exists():
        files.put(temporary, path)
        return
    files.sync_tree(temporary)
    if files.exchange(temporary, path):
        files.sync_names(path.parent)  # the old one has the temporary name, which is removed
        return
    aside = path.with_name(f".{path.name}.{os.getpid()}{OLD}")
    path.rename(aside)
    try:
        temporary.rename(path)
    except OSError:
        aside.rename(path)
        raise
    files.sync_names(path.parent)
    files.remove(aside)
