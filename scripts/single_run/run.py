# SPDX-License-Identifier: Apache-2.0
"""SLAMs on a recorded log or on a simulated tour: what is understood of it, in which map."""

import hashlib
import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from scripts.console import note, say, working
from scripts.film.encode import Pace
from scripts.film.footage import Footage, of_log, of_scene
from scripts.pace import Work, announce, timed
from scripts.single_run.session import Outputs, run_session
from slam import inputs
from slam.days.history import History
from slam.days.session import Session, keep, read_history
from slam.errors import InvalidValueError, MobiliaError
from slam.frames import EPOCH, NS_PER_S, Float, Stream, StreamMetadata
from slam.logs.mounting import Mounting
from slam.logs.repairs import WORDS
from slam.replay import Track
from slam.system import create
from slam.tracker.tracker import Tracker

UNTRUSTED = 1.0 / 3.0  # share of scans: more, and nobody should build on the run
UNTRUSTED_STATUS = 6  # exit status with --strict
SURE = 0.99  # probability from which on a mounting is named as the one


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
    if maps.map_out is None:
        inputs.release(target)  # the one that goes on from day to day
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


_log = logging.getLogger(__name__)


class UntrustedRunError(MobiliaError):
    """More than ``UNTRUSTED`` of the scans are not trusted, and --strict was given."""

    status = UNTRUSTED_STATUS


def mount_of(text: str | None) -> Float | None:
    """``--laser 0.1,0,180`` as (3,) m, m, rad; None for none."""
    if text is None:
        return None
    try:
        x, y, yaw_deg = (float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise InvalidValueError(f"--laser must be x,y,yaw_deg in m, m, deg, got {text!r}") from None
    return np.array([x, y, math.radians(yaw_deg)])


def tell(footage: Footage, *, strict: bool) -> list[Mounting]:
    """Say what the log holds, and where its scanner is not known to be mounted as it was read.

    Returns what ``MountingTest`` found. Raises ``InvalidValueError`` with ``strict`` where the
    scans contradict the mounting.
    """
    metadata = footage.stream.metadata
    say(understood(footage), highlight=False)
    if metadata.laser is None or not metadata.odometry:
        return []
    found = footage.tested.told() if footage.tested else []
    words = doubt(metadata, found)
    if words and strict and found and not found[0].as_read and found[0].probability > SURE:
        raise InvalidValueError(f"{footage.title}: {words} (refused by --strict)")
    if words:
        _log.warning("%s: %s", footage.title, words)
    return found


def understood(footage: Footage) -> str:
    """Topic or format, beams, field of view, rate, direction, and where the scanner is."""
    stream, metadata = footage.stream, footage.stream.metadata
    count = footage.scans or stream.length or 0
    rate = (count - 1) / footage.duration_s if footage.duration_s > 0.0 else 0.0
    extra = metadata.extra
    of = str(extra.get("scan") or extra.get("message") or "features")
    parts = [f"{metadata.source}, {of}"]
    if laser := metadata.laser:
        fov = math.degrees(laser.angles[-1] - laser.angles[0])
        parts.append(
            f"{laser.n_beams} beams over {fov:.0f}° "
            f"({extra.get('turned', 'counter-clockwise')}), up to {laser.range_max:.3g} m"
        )
    parts.append(f"{count} scans at {rate:.3g} Hz")
    if laser:
        by = f"by {metadata.mounting}" if metadata.mounting else "assumed"
        parts.append(f"scanner at {_place(laser.T_robot_laser)} on the robot, {by}")
    odometry = str(extra.get("odometry") or "none")
    parts.append(f"odometry: {odometry if metadata.odometry else 'none'}")
    return f"{footage.title}: {'; '.join(parts)}."


def _place(T_robot_laser: Float) -> str:
    x, y, turn = T_robot_laser.tolist()
    return f"x {_tidy(x)} m, y {_tidy(y)} m, turned {_tidy(math.degrees(turn), 1)}°"


def _tidy(value: float, digits: int = 3) -> str:
    return f"{round(value, digits) + 0.0:g}"


def flags(metadata: StreamMetadata, mounting: Mounting) -> str:
    """The options that read the log so."""
    assert metadata.laser is not None
    x, y, turn = metadata.laser.T_robot_laser.tolist()
    yaw = 180.0 - (180.0 - math.degrees(turn) - mounting.turned_deg) % 360.0  # in (-180, 180]
    words = f"--laser {_tidy(x)},{_tidy(y)},{_tidy(yaw, 1)}"
    return words + (" --flip" if mounting.flipped else "")


def doubt(metadata: StreamMetadata, found: Sequence[Mounting]) -> str:
    """What is to be said of the mounting; "" where the log says it and its scans agree."""
    ask = "" if metadata.mounting else "The log does not say how the scanner is mounted. "
    if not found:
        return ask and ask + "It was driven too little to tell. Give --laser x,y,yaw_deg (--flip)."
    best, as_read = found[0], next(one for one in found if one.as_read)
    if best.probability < SURE:
        likely = [one for one in found if one.probability > 1.0 - SURE]
        words = ", ".join(f"{one.probability:.0%} {flags(metadata, one)}" for one in likely)
        return ask and f"{ask}Its scans do not decide: {words}. Give one of them."
    if best.as_read:
        return ask and (
            f"{ask}Scans agree with odometry as it was read, ahead and counter-clockwise "
            f"({_odds(found)}, {_cm(best)} apart). If it is not at the robot's centre, say where: "
            f"--laser x,y,{flags(metadata, best).rpartition(',')[2]}"
        )
    return (
        f"{ask}Scans contradict odometry as the log was read ({_cm(as_read)} apart) and agree "
        f"under {flags(metadata, best)} ({_cm(best)} apart, {_odds(found)}). Give these options."
    )


def _odds(found: Sequence[Mounting]) -> str:
    """Of the best against the next."""
    odds = found[0].probability / max(found[1].probability, 1e-9)
    return f"{odds:.0f} to 1" if odds < 1e3 else "more than 1000 to 1"


def _cm(mounting: Mounting) -> str:
    return f"{100.0 * mounting.apart_m:.0f} cm"


def distrust(track: Track, footage: Footage, found: Sequence[Mounting]) -> str:
    """What to say where more than ``UNTRUSTED`` of the scans are not trusted; "" where fewer are.

    The causes come in the order of their likelihood: what the log itself gives away first.
    """
    share = float(np.mean([not one.converged for one in track.estimates]))
    if share <= UNTRUSTED:
        return ""
    causes: list[str] = []
    rest: list[str] = []
    metadata = footage.stream.metadata
    if found and not found[0].as_read and found[0].probability > SURE:
        causes.append(f"the scanner is mounted otherwise: {flags(metadata, found[0])}")
    elif not found or found[0].probability <= SURE or not metadata.mounting:
        rest.append("a wrong mounting (--laser x,y,yaw_deg, --flip)")
    if footage.empty > UNTRUSTED:
        causes.append(f"{footage.empty:.0%} of the scans return less than 10 % of beams")
    repaired = [key for key in WORDS if metadata.extra.get(key)]
    if any("stamp" in key or "clock" in key for key in repaired):
        causes.append("the times of the log, which had to be repaired")
    else:
        rest.append("scans and odometry on different clocks")
    if not metadata.odometry:
        causes.append("the log has no odometry")
    else:
        rest.append("wheels that slip, or odometry in other units")
    rest.append("a robot that was carried, or a room that moves as a whole")
    told = "; ".join([*causes, *rest])
    return f"{track.name} did not trust {share:.0%} of its scans. Likely causes, in order: {told}."


@dataclass(frozen=True, kw_only=True)
class Log:
    """A log to be run on.

    strict       refuse repairs, a mounting that its scans contradict, and a run that nobody trusts
    text_format  describes a text log
    laser, flip  how the scanner is mounted, where the log does not say it: ``mount_of``
    """

    path: Path
    strict: bool = False
    text_format: Path | None = None
    laser: str | None = None
    flip: bool = False


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
            mount=mount_of(log.laser), flip=log.flip,
        )  # fmt: skip
    found = tell(footage, strict=log.strict)
    show = footage.show(names)
    session = None
    if maps is not None and maps.given:
        session = session_of(show.primary, maps, footage.stream)
        show.replay.tracks[show.primary].system = session
    settings = {
        "slams": list(show.replay.tracks),
        "log": path.name,
        "log_sha256": hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None,
        "log_facts": dict(footage.stream.metadata.extra),
    }
    results = run_session(
        footage.stream,
        show,
        Outputs(
            folder=out,
            command="run",
            settings=settings,
            overwrite=overwrite,
            film=film,
            pace=Pace.of_log(footage.duration_s, footage.stream.length or 1),
        ),
    )
    if session is not None and maps is not None:
        kept(session, maps)
    words = distrust(show.track(), footage, found)
    if words and log.strict:
        raise UntrustedRunError(words)
    if words:
        _log.warning("%s", words)
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
    announce(f"{seconds:g} s of {settings['scene']}{filmed}", [work])
    if plan_only:
        return
    with timed(work), of_scene(settings, view="follow" if outputs.film else None) as footage:
        show = footage.show(names)
        if outputs.film and footage.no_camera:
            note(f"the film has no 3D panel: {footage.no_camera}")
        recipe = {"slams": list(show.replay.tracks), **settings, **footage.made_with}
        run_session(footage.stream, show, replace(outputs, settings=recipe))
