# SPDX-License-Identifier: Apache-2.0
"""SLAMs on a recorded log or on a simulated tour: what is understood of it, in which map."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scripts.console import note, working
from scripts.film.encode import Pace
from scripts.film.footage import of_log, of_scene
from scripts.metrics.judged import moved
from scripts.pace import Work, announce, timed
from scripts.single_run.log_words import UntrustedRunError, mount_of, tell, tell_distrust
from scripts.single_run.session import Outputs, run_session
from scripts.whole_folder import replaceable
from slam import inputs, se2
from slam.days.history import History
from slam.days.session import Session, keep, read_history
from slam.errors import InvalidValueError, MissingPathError
from slam.frames import EPOCH, NS_PER_S, Float, Stream
from slam.logs.bag_topics import Asked
from slam.replay import Track
from slam.system import create
from slam.tracker.tracker import Tracker
from slam.trajectory import Trajectory


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
        if self.map_in is not None and not self.map_in.exists():
            raise MissingPathError(self.map_in, "no such file")
        self.at_s()

    def at_s(self) -> float | None:
        """``at`` as s since 1970; ``InvalidValueError`` for what is no time."""
        if self.at is None:
            return None
        try:
            at = datetime.fromisoformat(self.at)
        except ValueError:
            raise InvalidValueError(
                f"--at must be a time such as 2026-05-04T09:00, got {self.at!r}"
            ) from None
        return at.replace(tzinfo=at.tzinfo or UTC).timestamp()


class SessionTrack(Track):
    """Of a session: its poses in the frame of its first one, wherever in the map that is."""

    system: Session

    def online(self) -> Trajectory:
        """All of them, as what moves the map between two of them is no motion."""
        return moved(self.system.trajectory(), se2.inverse(self.system.T_map_first))

    def final(self) -> None:
        """It has no others."""


def session_of(name: str, maps: Maps, stream: Stream) -> Session:
    """A session of that SLAM; ``InvalidValueError`` for one that cannot load a map."""
    system = create(name)
    if not isinstance(system, Tracker):
        raise InvalidValueError(
            f"SLAM '{name}' cannot go on in a map of a day before: shunting, occupancy can"
        )
    history = None if maps.map_in is None else read_history(maps.map_in)
    time_s = _time_s(maps, stream, history)
    if maps.map_in is None:
        return Session(system, time_s=time_s)
    return Session.open(maps.map_in, type(system), time_s=time_s)


def _time_s(maps: Maps, stream: Stream, history: History | None) -> float:
    """As ``--at`` says, else as the log's clock does, else 0 for a first session."""
    if (at_s := maps.at_s()) is not None:
        return at_s
    epoch_ns = int(stream.metadata.extra.get(EPOCH, 0))
    if epoch_ns > 0:
        return epoch_ns / NS_PER_S
    if history is not None and len(history):
        raise InvalidValueError("this log does not know its time: give it by --at 2026-05-04T09:00")
    return 0.0


def kept(session: Session, maps: Maps) -> bool:
    """Write the map where ``--map-out``, else ``--map-in``, says, and tell how it went.

    Returns whether the start was found.
    """
    target = maps.map_out or maps.map_in
    assert target is not None
    if maps.map_out is None:
        inputs.release(target)  # the one that goes on from day to day
    state = session.state
    written = keep(session, target)
    if state.found_after_s is None:
        why = "too little of what it saw is known there, or it looks the same elsewhere"
        note(f"the start was not found in the map: {why}; what was mapped lies in {written}")
    elif not state.fits:
        note(f"the session does not fit the map; what it made of it lies apart, in {written}")
    elif maps.map_in is not None:
        note(f"found after {state.found_after_s:.1f} s; the map with this session is {written}")
    else:
        note(f"the map of this session is {written}")
    return state.found_after_s is not None


@dataclass(frozen=True, kw_only=True)
class Log:
    """A log to be run on.

    strict       refuse repairs, a mounting that its scans contradict, and a run that nobody trusts
    text_format  describes a text log
    scan         topics of a bag's scanners; None: the likeliest
    odometry     topic of a bag's; None: the likeliest
    laser, flip  how the scanners are mounted, where the log does not say it: ``mount_of``
    """

    path: Path
    strict: bool = False
    text_format: Path | None = None
    scan: Sequence[str] | None = None
    laser: Sequence[str] | None = None
    flip: bool = False
    odometry: str | None = None

    def mounts(self) -> list[Float]:
        """``laser`` as ``mount_of`` reads it."""
        return [mount_of(text) for text in self.laser or ()]

    def __post_init__(self) -> None:
        self.mounts()  # complains


def on_log(
    names: list[str],
    log: Log,
    out: Path,
    *,
    overwrite: bool,
    film: bool,
    maps: Maps | None = None,
) -> dict[str, Any]:
    """Run SLAMs on a recorded log; the first of them in a map of days before, if ``maps`` says."""
    path = log.path
    with working(f"reading {path.name}"):
        footage = of_log(
            path, strict=log.strict, text_format=log.text_format,
            asked=[Asked(scan, log.odometry) for scan in log.scan or (None,)],
            mounts=log.mounts(), flip=log.flip,
        )  # fmt: skip
    found = tell(footage, strict=log.strict)
    show = footage.show(names)
    session = None
    if maps is not None and maps.given:
        session = session_of(show.primary, maps, footage.stream)
        show.replay.tracks[show.primary] = SessionTrack(show.primary, session)
    settings = {
        "slams": list(show.replay.tracks),
        "log": path.name,
        "log_sha256": hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None,
        "log_facts": dict(footage.stream.metadata.extra),
    }
    outputs = Outputs(
        folder=out, command="run", settings=settings, overwrite=overwrite, film=film,
        pace=Pace.of_log(footage.duration_s, footage.stream.length or 1),
    )  # fmt: skip
    results = run_session(footage.stream, show, outputs)
    if session is None or maps is None or kept(session, maps):
        tell_distrust(show.track(), footage, found, strict=log.strict)
    elif log.strict:  # the one cause of its doubt
        raise UntrustedRunError("the start was not found in the map (refused by --strict)")
    return results


def on_log_work(names: list[str], path: Path, film: bool) -> Work:
    """For an estimate: by the MB of a log, which is not read for it, for each SLAM."""
    files = path.rglob("*") if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return Work(f"run on {path.suffix}" + ", filmed" * film, size / 1e6 * len(names))


def on_scene(
    names: list[str], settings: Mapping[str, Any], outputs: Outputs, *, plan_only: bool = False
) -> None:
    """Say what is ahead; then, unless that is all (``plan_only``), run SLAMs on a tour of a scene.

    settings  scene, seconds, dynamism, seed; further keys go to ``Simulation``
    """
    seconds, filmed = settings["seconds"], ", filmed" * outputs.film
    work = Work(f"run on a scene{filmed}", seconds * len(names))
    view = "follow" if outputs.film and not plan_only else None
    with of_scene(settings, view=view) as footage:
        show = footage.show(names)
        recipe = {"slams": list(show.replay.tracks), **settings, **footage.made_with}
        replaceable(outputs.folder, outputs.overwrite, outputs.command, recipe)
        announce(f"{seconds:g} s of {settings['scene']}{filmed}", [work])
        if plan_only:
            return
        if outputs.film and footage.no_camera:
            note(f"the film has no 3D panel: {footage.no_camera}")
        with timed(work):
            run_session(footage.stream, show, replace(outputs, settings=recipe))
