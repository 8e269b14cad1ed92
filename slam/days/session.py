# SPDX-License-Identifier: Apache-2.0
"""One session in a map of days: its start is anywhere, and what it maps is merged if it fits.

session = Session.open(Path("m.npz"), ShuntingSlam, time_s=86_400.0 + 9 * 3600.0)
for frame in frames:
    estimate = session.update(frame)
keep(session, Path("m.npz"))
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slam import se2
from slam.arrays import Float
from slam.days.evidence import CELL_M, EVERY_S, SessionGrid
from slam.days.habits import DaysRaster, MobilityMap
from slam.days.history import NAMES, History, News
from slam.days.search import FITS, KNOWN, SPOILS, Agreement, Past, StartSearch
from slam.errors import InvalidValueError, LogFormatError
from slam.estimate import Changes, Estimate, Raster
from slam.frames import Frame, to_s
from slam.path import PosePath
from slam.tracker import map_file
from slam.tracker.belief.places import coarse
from slam.tracker.belief.state import State
from slam.tracker.tracker import Tracker
from slam.trajectory import Trajectory

SEARCHING = "searching"  # ``diagnostics["state"]`` until the start is found
OUTDATED = 0.05  # share of the returns: the map is outdated here; set by hand
_TRACKED = ("tracking", "relocated", "blind")


@dataclass(frozen=True, kw_only=True)
class SessionState:
    """How a session went so far.

    found_after_s   until the start was found; 0 in a new map, None: not found
    merged          scans of the search that were merged
    tracked         share of the scans after the find that were tracked
    disagrees       share of what it saw that does not fit the days before (``Agreement``)
    fits            whether the map may be replaced by what the session made of it
    """

    found_after_s: float | None
    merged: int
    tracked: float
    disagrees: float
    fits: bool


class Session:
    """A SLAM (``slam.system.SlamSystem``) whose map has a past.

    tracker   with the map of the days before, or an empty one for the first day
    history   of the sessions before; None: none
    time_s    when the session begins, s since a midnight, later than all of ``history``
    found     False: the start is unknown and is searched for
    """

    cells_hold, takes_several = "activities", True

    def __init__(
        self, tracker: Tracker, *, time_s: float, history: History | None = None, found: bool = True
    ) -> None:
        if not math.isfinite(time_s):
            raise InvalidValueError(f"Session.time_s must be finite, got {time_s}")
        self.history = history or History(cell_m=CELL_M)
        self.history.check_later(time_s)
        self.tracker, self.time_s = tracker, float(time_s)
        tracker.hold_map()  # what a session keeps of places lies in it
        self._found, self._new = found, found
        self.reset()

    @classmethod
    def open(cls, path: Path, kind: type[Tracker], *, time_s: float) -> "Session":
        """A session in the map of a file, its start unknown; ``LogFormatError`` as ``load``.

        A map of before days, or one that a single run saved, has no history: it begins here.
        """
        history = read_history(path)
        return cls(kind.load(path), time_s=time_s, history=history, found=False)

    def reset(self) -> None:
        """Forget this session; a map that was already written to cannot be taken back."""
        self._grid = SessionGrid(self.history.cell_m)
        self._past = Past(self.history)
        self._news, self._news_share = News(self.history), 0.0
        self._asked_ns: int | None = None
        self._search = None if self._new else StartSearch(self.tracker, self._past)
        self._path, self._T_map_own = PosePath(), np.zeros(3)
        self._searched = 0  # poses that are in the session's own frame
        self._found_after_s: float | None = 0.0 if self._new else None
        self._merged = 0
        self._after = self._tracked = 0  # scans since it was found
        self._state, self._lost_s, self._gave_up = "", 0.0, False
        self._before_ns: int | None = None

    def update(self, frame: Frame) -> Estimate:
        """As a ``SlamSystem``'s. While the start is searched for, poses are in the session's own
        frame, ``converged`` is False and ``diagnostics["state"]`` is "searching". In a map with
        days, "news" is the share of the returns that they did not know (``history.News``), and
        "state" is "map outdated here" where that is much.
        """
        if self._search is not None:
            return self._look(self._search, frame)
        return self._go_on(frame)

    def _look(self, search: StartSearch, frame: Frame) -> Estimate:
        estimate, place = search.take(frame)
        if place is not None:
            return self._begin(search, frame, place, estimate.T_map_robot)
        self._path.add(frame.stamp_ns, estimate.T_map_robot)
        self._searched = len(self._path)
        return replace(
            estimate,
            converged=False,
            diagnostics={**estimate.diagnostics, "state": SEARCHING},
        )

    def _begin(self, search: StartSearch, frame: Frame, place: Float, own: Float) -> Estimate:
        """The start is found: go on in the known map."""
        self._T_map_own, self._search = place, None
        self._found_after_s = search.elapsed_s
        self._merged = search.merge(place)
        for earlier, pose in search.seen:
            self._grid.add(earlier, se2.compose(place, pose))
        numbers = self.tracker.config.tracking.relocalise
        self.tracker.place(se2.compose(place, own), coarse(numbers))
        found = self._go_on(frame)
        moved = {"correction": place.tolist()}  # so is all that was seen so far
        return replace(found, diagnostics={**found.diagnostics, **moved})

    def _go_on(self, frame: Frame) -> Estimate:
        estimate = self.tracker.update(frame)
        self._state = str(estimate.diagnostics.get("state", ""))
        tracked = self._state in _TRACKED
        self._after, self._tracked = self._after + 1, self._tracked + tracked
        if self._before_ns is not None:
            elapsed = to_s(frame.stamp_ns - self._before_ns)
            self._lost_s = 0.0 if tracked else self._lost_s + elapsed
            give_up_s = self.tracker.config.tracking.give_up_s
            self._gave_up |= self._lost_s > give_up_s
        self._before_ns = frame.stamp_ns
        reported = self._with_news(frame, estimate)
        if estimate.converged:
            self._grid.add(frame, estimate.T_map_robot)
        self._path.add(frame.stamp_ns, estimate.T_map_robot)
        return reported

    def _with_news(self, frame: Frame, estimate: Estimate) -> Estimate:
        """The estimate with what of the scan is news; asked as often as scans are counted."""
        if not self._news.known:
            return estimate
        if not estimate.converged:
            self._news_share = 0.0
        elif self._asked_ns is None or to_s(frame.stamp_ns - self._asked_ns) >= EVERY_S:
            self._news_share = self._news.share(frame, estimate.T_map_robot)
            self._asked_ns = frame.stamp_ns
        found = {**estimate.diagnostics, "news": self._news_share}
        if self._state == State.TRACKING and self._news_share >= OUTDATED:
            found["state"] = State.OUTDATED.value
        return replace(estimate, diagnostics=found)

    @property
    def T_map_first(self) -> Float:
        """(3,) where the first frame is in the map; zeros while it is not found."""
        return self._T_map_own.copy()

    def poses_in_map(self) -> Float:
        """(n, 3) of all frames; in the session's own frame while its start is not found."""
        return self.trajectory().poses

    @property
    def state(self) -> SessionState:
        """How it went so far."""
        share = self._tracked / self._after if self._after else 0.0
        ended = self._state in _TRACKED and not self._gave_up
        agreement = self.agreement()
        known = agreement.known >= KNOWN
        rejected = known and agreement.disagrees > SPOILS
        fits = self._search is None and ended and share >= FITS and not rejected
        return SessionState(
            found_after_s=self._found_after_s,
            merged=self._merged,
            tracked=share,
            disagrees=agreement.disagrees,
            fits=fits,
        )

    def agreement(self) -> Agreement:
        """How what this session saw so far fits the days before; empty while it is not found."""
        if self._search is not None or not self._grid.scans:
            return Agreement()
        return self._past.agreement(self._grid.snapshot(self.time_s))

    def known(self) -> History:
        """The history with this session, if it was found and has seen anything."""
        if self._search is not None or not self._grid.scans:
            return self.history
        snapshot = self._grid.snapshot(self.time_s)
        return self.history.with_session(snapshot)

    def mobility(self) -> MobilityMap:
        """How often and how long things stand, by place; this session included."""
        return MobilityMap(self.known())

    def map(self) -> Raster | None:
        """The SLAM's map, of the session alone while it is not found; with ``mobility``."""
        source = self.tracker if self._search is None else self._search.alone
        raster = source.map()  # type: ignore[attr-defined]
        return None if raster is None else DaysRaster.of(raster, self.mobility())

    def changes(self) -> Changes | None:
        """Short-term against long-term memory, as the SLAM's own."""
        found: Changes | None = getattr(self.tracker, "changes", lambda: None)()
        return found

    def trajectory(self) -> Trajectory:
        """All poses in the map's frame; in the session's own while its start is not found."""
        online = self._path.poses()
        for k in range(self._searched if self._search is None else 0):
            online[k] = se2.compose(self._T_map_own, online[k])
        return self._path.trajectory(online)

    def save(self, path: Path) -> None:
        """Write the map and its history, this session included; of one whose start was not found,
        what it mapped alone. Raises ``OutputError``. ``keep`` decides what may be replaced.
        """
        if self._search is not None:
            self._search.alone.save(path)
            return
        history = self.known()
        self.tracker.save(path, history.arrays() if len(history) else None)


def searched(estimates: Iterable[Estimate]) -> int:
    """Scans before the start was found."""
    return sum(one.diagnostics.get("state") == SEARCHING for one in estimates)


def read_history(path: Path) -> History | None:
    """Of a map file; None for one without. Raises ``LogFormatError``."""
    extra = map_file.read_extra(path)
    if not any(name.startswith("day_") for name in extra):
        return None
    missing = [name for name in NAMES if name not in extra]
    if missing:
        raise LogFormatError(path, f"a map of days without {missing[0]}")
    return History.of_arrays(path, extra)


def keep(session: Session, path: Path) -> Path:
    """Write the map to ``path`` if the session fits it; else beside it, ``m.apart.npz``.

    Returns where it was written. A map at ``path`` that the session does not fit stays as it was.
    Raises ``OutputError``.
    """
    if session.state.fits:
        session.save(path)
        return path
    for number in range(1, 1000):
        apart = path.with_name(f"{path.stem}.apart{number}{path.suffix}")
        if not apart.exists():
            session.save(apart)
            return apart
    raise InvalidValueError(f"{path}: 999 sessions are kept separately beside it already")
