# SPDX-License-Identifier: Apache-2.0
"""SLAMs over the sessions of a building: each session is localised in the map of those before."""

import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison.maps import NEAR_M, Believed, StaticDistance, clearance, seen_empty
from scripts.comparison.recording import Recording
from scripts.comparison.tables import Row
from scripts.days import truth
from scripts.days.sessions import SessionDrive, loaded
from scripts.days.truth import Still, stands_there, still_things
from scripts.names import file_name
from scripts.result_files import load
from slam import se2
from slam.days.evidence import Snapshot
from slam.days.session import Session, keep, searched
from slam.errors import LogFormatError, SlamFailedError
from slam.files import write_text
from slam.frames import NS_PER_S, Float
from slam.guests import Limits, limited
from slam.replay import Replay, Track
from slam.system import create
from slam.tracker.tracker import Tracker

RIGHT_M, RIGHT_RAD = 0.5, 0.35  # of the true pose: the place that was found is the right one
SCHEMA = 1  # of the file of a life
_KEYS = {"rows": list, "ages": list, "failure": str | None}
KNOWN_M = 0.3  # a start so near to a place that was seen is known
COLUMNS = (
    "slam", "session", "time_of_day", "map", "start", "found_after_s", "place", "rmse_m", "worst_m",
    "disagrees", "outdated_told", "outdated_false", "tracked", "ghost_rate", "ghost_seen_rate",
    "recall", "map_kb", "memory_mb", "load_s", "ms_per_scan",
)  # fmt: skip
"""Of lifelong.csv. The last two are about the machine."""


@dataclass(eq=False)
class Building:
    """What one SLAM knows of a building.

    map         its file, written from session to session
    anew        it cannot load a map: every session is the first
    T_map_world the frame of the first session's map; None before, or without truth
    snapshots   what each session that fitted saw, by its number
    copies      its map after each of them, where maps of some age are asked for
    before      the last session that was merged, where it was simulated
    limits      of a SLAM from outside, which then runs in a process of its own; None: here
    failures    what was said when it failed, in order
    replays     folder for a page of each session (``scripts.live.replay``); None: no pages
    """

    name: str
    map: Path
    anew: bool = False
    T_map_world: Float | None = None
    snapshots: dict[int, Snapshot] = field(default_factory=dict)
    copies: dict[int, Path] = field(default_factory=dict)
    before: Recording | None = None
    limits: Limits | None = None
    failures: list[str] = field(default_factory=list)
    replays: Path | None = None

    def session(self, path: Path, drive: SessionDrive) -> Session:
        """A session in the map of a file, or the first one where there is no such file."""
        system = create(self.name)
        assert isinstance(system, Tracker)
        if not path.exists():
            return Session(system, time_s=drive.time_s)
        return Session.open(path, type(system), time_s=drive.time_s)


def started(names: Sequence[str], folder: Path, limits: Limits | None = None) -> list[Building]:
    """Buildings of which nothing is known. With ``limits`` a SLAM from outside cannot load a map:
    it is in another process, and no message there is about one.
    """
    return [
        Building(
            name=name,
            map=folder / f"map_{file_name(name)}.npz",
            anew=(limits is not None and ":" in name) or not isinstance(create(name), Tracker),
            limits=limits,
        )
        for name in names
    ]


def lived(
    buildings: Sequence[Building], drives: Iterator[SessionDrive]
) -> tuple[list[Row], list[Row]]:
    """A row (``COLUMNS``) for each session and SLAM, and those of the last session in older maps
    (``truth.AGE_COLUMNS``).
    """
    rows, aged = [], []
    for drive in drives:
        rows += [_row(building, drive) for building in buildings]
        last = drive
    for building in buildings:
        aged += [] if building.anew else list(_age_rows(building, last))
    return rows, aged


def _row(building: Building, drive: SessionDrive) -> Row:
    """A session in the map so far, or on its own where the SLAM cannot load a map."""
    first = not building.map.exists()
    head: Row = {
        **dict.fromkeys(COLUMNS), "slam": building.name, "session": drive.number,
        "time_of_day": drive.time_of_day,
        "map": "anew" if building.anew else "new" if first else "kept",
    }  # fmt: skip
    try:
        started = time.process_time()
        session = None if building.anew else building.session(building.map, drive)
        loaded_s = time.process_time() - started
        system = limited(building.name, building.limits) if session is None else session
        track = Track(building.name, system)
        if failure := _survive(building, drive, track):
            raise failure
        row = head | {"ms_per_scan": 1e3 * float(np.median(track.durations_s))}
        if session is None:
            return row | _anew(drive, track)
        return row | {"load_s": loaded_s} | _merged(building, drive, session, track)
    except SlamFailedError as error:  # at its start, on the way, or what it gave as its map
        building.failures.append(str(error))
        return head | {"place": "failed"}


def _anew(drive: SessionDrive, track: Track) -> Row:
    """Of a session on its own, in its own frame."""
    truth = drive.frames[0].truth
    T_map_world = None if truth is None else se2.inverse(truth)
    errors = _errors(T_map_world, drive, track, 0)
    return {**errors, "place": "", **_map_scores(T_map_world, drive, track)}


def _merged(building: Building, drive: SessionDrive, session: Session, track: Track) -> Row:
    """Of a session in the map so far, which is merged into it if it fits."""
    state, first, truth_0 = session.state, not building.map.exists(), drive.frames[0].truth
    if first and truth_0 is not None:
        building.T_map_world = se2.inverse(truth_0)
    looked = searched(track.estimates)
    row: Row = {
        "start": _start(session, building.T_map_world, drive),
        "disagrees": None if first or state.found_after_s is None else state.disagrees,
        "found_after_s": state.found_after_s, "tracked": state.tracked,
        **_errors(building.T_map_world, drive, track, looked),
    }  # fmt: skip
    written = keep(session, building.map)
    row["map"] = "new" if first else "merged" if state.fits else written.name
    row["map_kb"] = written.stat().st_size / 1e3
    row["memory_mb"] = sum(a.nbytes for a in session.tracker.cell_map.cells) / 1e6
    if state.found_after_s is not None:
        row |= _map_scores(building.T_map_world, drive, track)
        if building.before is not None and drive.recording is not None:
            shares = truth.changed_share(building.before, drive.recording)
            row |= truth.verdicts(track.estimates, shares, looked)
    if state.fits:  # else the map knows nothing of it
        building.before = drive.recording
        building.snapshots[drive.number] = session.known().sessions[-1]
        building.copies[drive.number] = truth.keep_copy(
            building.map, building.map.parent / "maps", drive.number
        )
    return row


def _age_rows(building: Building, drive: SessionDrive) -> Iterator[Row]:
    """Of that session in maps some sessions old; none of them is written to."""
    for age, number in truth.ages_of(sorted(building.copies), drive.number):
        session = building.session(building.copies[number], drive)
        track = Track(building.name, session)
        row: Row = dict.fromkeys(truth.AGE_COLUMNS)
        row |= {"slam": building.name, "age": age, "session": drive.number}
        if track.survive(drive.frames) is not None:
            yield row | {"place": "failed"}
            continue
        state = session.state
        row |= {"found_after_s": state.found_after_s, "tracked": state.tracked}
        yield row | _errors(building.T_map_world, drive, track, searched(track.estimates))


def _start(session: Session, T_map_world: Float | None, drive: SessionDrive) -> str:
    """Whether a session before this one saw the place where the robot starts; "" without truth."""
    truth, history = drive.frames[0].truth, session.history
    if T_map_world is None or truth is None or not len(history):
        return ""
    at = se2.compose(T_map_world, truth)[:2]
    cells, _ = history.table()
    near = np.hypot(*((cells + 0.5) * history.cell_m - at).T) < KNOWN_M
    return "known" if near.any() else "unknown"


def _survive(building: Building, drive: SessionDrive, track: Track) -> SlamFailedError | None:
    """Let it see every frame, and make a page of that where one is wanted; what ended it."""
    if building.replays is None:
        return track.survive(drive.frames)
    from scripts.live.replay import Recorder
    from sim.view.moment import Moments

    truth = drive.frames[0].truth
    seconds = (drive.frames[-1].stamp_ns - drive.frames[0].stamp_ns) / NS_PER_S
    T_map_world = None if truth is None else building.T_map_world
    T_world_map = None if T_map_world is None else se2.inverse(T_map_world)
    moments = Moments(Replay({building.name: track}), T_world_map)
    with Recorder.writing(
        building.replays / f"{file_name(building.name)}-{drive.number:02}.html",
        moments,
        title=f"{building.name} · session {drive.number}, {drive.time_of_day}",
        seconds=seconds,
    ) as recorder:  # fmt: skip
        return track.survive(recorder.noting(drive.frames))


def _errors(T_map_world: Float | None, drive: SessionDrive, track: Track, looked: int) -> Row:
    """Of the poses from the scan on that found the start; ``place`` is where that was."""
    if looked == len(track.estimates):
        return {"place": "not found"}
    if T_map_world is None or drive.frames[0].truth is None:
        return {"place": ""}
    off = np.array(
        [
            se2.between(se2.compose(T_map_world, frame.truth), estimate.T_map_robot)
            for frame, estimate in zip(drive.frames, track.estimates, strict=True)
            if frame.truth is not None
        ]
    )[looked:]
    away = np.hypot(off[:, 0], off[:, 1])
    right = away[0] < RIGHT_M and abs(off[0, 2]) < RIGHT_RAD
    return {
        "place": "right" if right else "wrong",
        "rmse_m": float(np.sqrt((away**2).mean())),
        "worst_m": float(away.max()),
    }


def _map_scores(T_map_world: Float | None, drive: SessionDrive, track: Track) -> Row:
    """Ghosts and recall of the map at the end of a simulated session."""
    recording, raster = drive.recording, track.map()
    if recording is None or raster is None or T_map_world is None:
        return {}
    believed = Believed(raster, se2.inverse(T_map_world))
    occupied = believed.occupied()
    near = StaticDistance(recording.static_map)(occupied)
    near = np.minimum(near, clearance(occupied, recording, len(recording.frames) - 1))
    held = [believed.holds(thing.points) for thing in _standing(recording)]
    ghosts = occupied[near > NEAR_M]
    seen, n = seen_empty(ghosts, recording).sum(), len(occupied)
    return {
        "ghost_rate": len(ghosts) / n if n else None,
        "ghost_seen_rate": float(seen) / n if n else None,
        "recall": float(np.mean(held)) if held else None,
    }


def _standing(recording: Recording) -> list[Still]:
    """Movable things that stood still in the session and were seen, still there at its end."""
    return [
        thing
        for thing in still_things(recording)
        if not thing.kind.startswith("person")
        and stands_there(thing, recording.poses[-1, thing.row])
        and len(thing.points)
    ]


def live(
    path: Path, *, sessions: Sequence[str], slam: str, scan_limit_s: float = Limits.scan_s
) -> None:
    """A job: let ``slam`` live through the recordings ``sessions`` (beside ``path``'s folder), and
    write its rows (``COLUMNS``, ``truth.AGE_COLUMNS``) to ``path`` as JSON.

    Its maps are not kept. A SLAM from outside runs in a process of its own for each session; one
    that fails, even at its start, is a row.
    """
    out = path.parent.parent
    limits = Limits(scan_s=scan_limit_s)
    with tempfile.TemporaryDirectory() as folder:
        (building,) = started([slam], Path(folder), limits)
        rows, aged = lived([building], loaded([out / name for name in sessions]))
    failure = building.failures[0] if building.failures else None
    whole = {"schema": SCHEMA, "rows": rows, "ages": aged, "failure": failure}
    write_text(path, json.dumps(whole, indent=1) + "\n")


def read(path: Path) -> dict[str, Any]:
    """What ``live`` wrote: "rows", "ages" and "failure"; ``LogFormatError`` for anything else."""
    found = load(path, "rows of a building", SCHEMA)
    wrong = [key for key, kind in _KEYS.items() if not isinstance(found.get(key), kind)]
    if wrong or not found["rows"]:
        raise LogFormatError(path, f"rows of a building without '{(wrong or ['rows'])[0]}'")
    return found
