# SPDX-License-Identifier: Apache-2.0
"""The sessions of one building, from a dataset of ``mobilia generate --sessions`` or made here."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from scripts.comparison.recording import Recording, load, record
from scripts.options import whole
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.world.times_of_day import MOST_SESSIONS, clock_s, time_of
from slam.errors import LogFormatError, MissingPathError
from slam.frames import Frame
from slam.logs import open_log

EVERY = 5  # of the scans of a simulated session one in so many is kept: 7.5 a second


@dataclass(frozen=True, kw_only=True, eq=False)
class SessionDrive:
    """One session.

    recording  what a simulated one also holds: what stood where, what each beam met; else None
    """

    number: int
    frames: Sequence[Frame]
    recording: Recording | None = None

    @property
    def time_s(self) -> float:
        """When it begins, since midnight before the first one."""
        return clock_s(self.number)

    @property
    def time_of_day(self) -> str:
        """In a word."""
        return time_of(self.number).name


def simulated(recipe: Recipe, sessions: int, first_seconds: float) -> Iterator[SessionDrive]:
    """Sessions 0, 1, ... of a building; the first, which maps it, lasts ``first_seconds``."""
    for number in range(sessions):
        seconds = first_seconds if number == 0 else recipe.seconds
        wanted = replace(recipe, session=number, seconds=seconds)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "session.npz"
            record(path, every=EVERY, **asdict(wanted))
            drive = load(path)
        yield SessionDrive(number=number, frames=drive.frames, recording=drive)


def loaded(files: Sequence[Path]) -> Iterator[SessionDrive]:
    """The same from files, one for each session from 0 on, as ``record`` wrote them."""
    for number, path in enumerate(files):
        drive = load(path)
        yield SessionDrive(number=number, frames=drive.frames, recording=drive)


def recorded(folder: Path) -> list[tuple[int, Path]]:
    """Numbers and folders of the episodes of a dataset of sessions, in order.

    Raises ``MissingPathError`` for no folder, ``LogFormatError`` for one without any, or with
    sessions of several buildings.
    """
    found: dict[int, Path] = {}
    buildings = set()
    for path in sorted(p.parent for p in folder.glob(f"*/{RECIPE}")):
        recipe = read_recipe(path / RECIPE).recipe
        if recipe.session is None:
            continue
        if recipe.session in found:
            raise LogFormatError(folder, f"holds session {recipe.session} twice")
        found[recipe.session] = path
        buildings.add((recipe.scene, recipe.seed, recipe.share_changed))
    if not found:
        if not folder.is_dir():
            raise MissingPathError(folder, "no such folder")
        raise LogFormatError(
            folder, "holds no sessions: mobilia generate SCENE --sessions 10 makes some"
        )
    if len(buildings) > 1:
        raise LogFormatError(folder, f"holds sessions of {len(buildings)} buildings, not of one")
    return sorted(found.items())


def read(folder: Path) -> Iterator[SessionDrive]:
    """The sessions of a dataset, in order."""
    for number, path in recorded(folder):
        yield SessionDrive(number=number, frames=list(open_log(path).frames()))


def checked_count(sessions: int) -> int:
    """From 2 to ``MOST_SESSIONS``; ``InvalidValueError`` otherwise."""
    whole("--sessions", sessions, 2, MOST_SESSIONS)
    return sessions
