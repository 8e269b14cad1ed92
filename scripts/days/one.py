# SPDX-License-Identifier: Apache-2.0
"""One session of ``mobilia run``: which map it begins in, at what time, and where it is kept."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from scripts.console import note
from slam.days.history import History
from slam.days.session import Session, keep, read_history
from slam.errors import InvalidValueError
from slam.frames import EPOCH, NS_PER_S, Stream
from slam.system import create
from slam.tracker.tracker import Tracker


@dataclass(frozen=True, kw_only=True)
class Maps:
    """``--map-in``, ``--map-out`` and ``--at``; None: not given."""

    map_in: Path | None = None
    map_out: Path | None = None
    at: str | None = None

    @property
    def given(self) -> bool:
        """Whether the run is a session at all."""
        return self.map_in is not None or self.map_out is not None

    def __post_init__(self) -> None:
        if self.at is not None and not self.given:
            raise InvalidValueError("--at is about --map-in or --map-out")


def session_of(name: str, maps: Maps, stream: Stream) -> Session:
    """A session of that SLAM; ``InvalidValueError`` for one that cannot load a map."""
    system = create(name)
    if not isinstance(system, Tracker):
        raise InvalidValueError(
            f"SLAM '{name}' cannot go on in a map of a day before: shunting, occupancy can"
        )
    history = None if maps.map_in is None else read_history(maps.map_in)
    time_s = _time_s(maps, stream, history)
    if history is not None and len(history) and time_s <= history.times_s[-1]:
        raise InvalidValueError(
            f"the session begins at {time_s:.15g} s, not after the last one of the map, at "
            f"{history.times_s[-1]:.15g} s: say when it was, as --at 2026-05-04T09:00"
        )
    if maps.map_in is None:
        return Session(system, time_s=time_s)
    return Session.open(maps.map_in, type(system), time_s=time_s)


def _time_s(maps: Maps, stream: Stream, history: History | None) -> float:
    """As ``--at`` says, else as the log's clock does, else 0 for a first session."""
    if maps.at is not None:
        try:
            at = datetime.fromisoformat(maps.at)
        except ValueError:
            raise InvalidValueError(
                f"--at must be a time such as 2026-05-04T09:00, got {maps.at!r}"
            ) from None
        return at.replace(tzinfo=at.tzinfo or UTC).timestamp()
    epoch_ns = int(stream.metadata.extra.get(EPOCH, 0))
    if epoch_ns > 0:
        return epoch_ns / NS_PER_S
    if history is not None and len(history):
        raise InvalidValueError("this log does not know its time: give it by --at 2026-05-04T09:00")
    return 0.0


def kept(session: Session, maps: Maps) -> None:
    """Write the map where ``--map-out``, else ``--map-in``, says, and tell how it went."""
    target = maps.map_out or maps.map_in
    assert target is not None
    state = session.state
    written = keep(session, target)
    if state.found_after_s is None:
        note(f"the start was not found in the map; what was mapped lies apart, in {written}")
    elif not state.fits:
        note(f"the session does not fit the map; what it made of it lies apart, in {written}")
    elif maps.map_in is not None:
        note(f"found after {state.found_after_s:.1f} s; the map with this session is {written}")
    else:
        note(f"the map of this session is {written}")
