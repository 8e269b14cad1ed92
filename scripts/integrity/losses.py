# SPDX-License-Identifier: Apache-2.0
"""What one case of a way to get lost comes to: one SLAM over one stream, carried or pushed."""

import copy
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.integrity import kidnap
from scripts.integrity.counting import Moments, binned, stretches
from scripts.integrity.plane import frames
from scripts.integrity.ways import EACH, WAYS, Case
from scripts.metrics.judged import Judged, world_truth
from scripts.result_files import write
from slam import se2
from slam.errors import InvalidValueError, SlamFailedError
from slam.frames import Float, Frame, Stream
from slam.logs import open_log
from slam.replay import Track
from slam.system import MovingMap, SlamSystem, create, refuse_at_the_end

PUSHED = (0.3, 0.85)  # of the stream: when it is pushed
LOG_SHARES = (0.4, 1.0)  # of a log: how much of it was seen when the robot is carried
STEADY = 5  # the first scans may compile: no timings
Row = dict[str, Any]


@dataclass(eq=False)
class Tally:
    """What a case comes to: the drive itself, each loss, and why it ended before its end."""

    drive: Row = field(default_factory=dict)
    losses: list[Row] = field(default_factory=list)
    failed: str = ""


def settle(path: Path, *, case: Row, config: Row) -> None:
    """Write what a case comes to. ``config`` is that of its SLAM: part of what made the file."""
    write(path, {"case": case, "config": config, **run(Case(**case))}, {})


def run(case: Case) -> Row:
    """Raises ``InvalidValueError`` for a SLAM to which this cannot be done."""
    system, tally = create(case.slam), Tally()
    refuse_at_the_end(system, case.slam, "a loss")
    event = {"": _streamed, "kidnap": _carried, "push": _pushed, "log": _in_log}
    try:
        event[WAYS[case.way].event](tally, case, system)
    except SlamFailedError as error:
        tally.failed = str(error)
    return asdict(tally)


def _streamed(tally: Tally, case: Case, system: SlamSystem) -> None:
    """The whole stream is the loss."""
    stream = frames(case.spec)
    tally.drive, run_ = _drive(_survived(Track(case.slam, system), stream), stream)
    tally.losses.append({"event": ""} | _loss(run_, trusted_before=True))


def _carried(tally: Tally, case: Case, system: SlamSystem) -> None:
    """Kidnaps to where it stands at moments of another tour through the same building."""
    mapped, later = frames(case.spec), frames(replace(case.spec, again=1))
    track = _survived(Track(case.slam, system), mapped)
    tally.drive, run_ = _drive(track, mapped)
    if run_.right()[-1]:
        _kidnap(tally, track, mapped, later)


def _in_log(tally: Tally, case: Case, system: SlamSystem) -> None:
    """Kidnaps in a log: the places where the first pass saw it count as the true ones."""
    rng = np.random.default_rng([case.first_seed, case.number])
    log = open_log(Path(case.log))
    if isinstance(log, Stream) and not log.metadata.odometry:
        raise InvalidValueError(f"{case.log} has no odometry, which a carried robot must have")
    stream = [frame for frame in log if frame.scan is not None]
    stream = stream[: max(round(rng.uniform(*LOG_SHARES) * len(stream)), 2)]
    track = _survived(Track(case.slam, system), stream)
    places = [estimate.T_map_robot for estimate in track.estimates]
    if isinstance(system, MovingMap):
        places = list(system.poses_in_map())
    places[0] = np.zeros(3)  # the first pose is the map's frame, in which the others are told
    mapped = [replace(frame, truth=place) for frame, place in zip(stream, places, strict=True)]
    tally.drive = _spent(track, STEADY)
    _kidnap(tally, track, mapped, mapped)


def _kidnap(tally: Tally, track: Track, mapped: list[Frame], later: list[Frame]) -> None:
    """``EACH`` losses after ``mapped``, to the poses of ``later``."""
    scans = kidnap.scans_after(mapped)
    for start in kidnap.targets(mapped, later, scans, EACH):
        after = list(kidnap.kidnapped(mapped, later, start, scans))
        moved = se2.between(_truth(mapped[-1]), _truth(after[0]))
        then = _followed(track, len(mapped), after, np.zeros(3))
        run_ = _moments(then, [*mapped, *after]).since(len(mapped))
        loss = {"event": "kidnap", "moved_m": math.hypot(*moved[:2].tolist())}
        tally.losses.append(loss | _event(run_, run_) | _spent(then, len(mapped)))


def _pushed(tally: Tally, case: Case, system: SlamSystem) -> None:
    """Pushes at drawn moments, of each kind in turn."""
    if not hasattr(system, "displace"):
        raise InvalidValueError(f"SLAM '{case.slam}' cannot be pushed: it has no displace()")
    stream, track = frames(case.spec), Track(case.slam, system)
    rng = np.random.default_rng([case.spec.seed, case.number])
    low, high = (round(share * len(stream)) for share in PUSHED)
    moments = {int(k): n for n, k in enumerate(rng.choice(range(low, high), EACH, replace=False))}
    kept = {}
    for k, frame in enumerate(stream):
        if k in moments:
            kept[k] = copy.deepcopy(track)
        _survived(track, [frame])
    tally.drive, run_ = _drive(track, stream)
    right, scans = run_.right(), round(kidnap.AFTER_S * case.spec.settings.rate_hz)
    for k, before in kept.items():
        kind = kidnap.KINDS[moments[k] % len(kidnap.KINDS)]
        by, end = kidnap.push(kind, rng), k + scans
        then = _followed(before, k, stream[k:end], by)
        if right[k - 1]:
            unpushed = [
                replace(frame, truth=estimate.T_map_robot)
                for frame, estimate in zip(stream[:end], track.estimates, strict=False)
            ]
            run_, beside = (_moments(then, truth).since(k) for truth in (stream[:end], unpushed))
            loss = _event(run_, beside, kidnap.BACK_M, math.radians(kidnap.BACK_DEG))
            tally.losses.append({"event": f"push {kind}"} | loss | _spent(then, k))


def _truth(frame: Frame) -> Float:
    assert frame.truth is not None
    return frame.truth


def _survived(track: Track, stream: Sequence[Frame]) -> Track:
    """``track``, which has seen ``stream`` too; ``SlamFailedError`` where it fails."""
    error = track.survive(stream)
    if error is not None:
        raise error
    return track


def _followed(track: Track, k: int, after: Sequence[Frame], by: Float) -> Track:
    """A copy of ``track`` up to scan ``k``, displaced by ``by``, that saw ``after`` too."""
    system = copy.deepcopy(track.system)
    if by.any():
        system.displace(by)  # type: ignore[attr-defined]
    return _survived(Track(track.name, system, track.estimates[:k], track.durations_s[:k]), after)


def _moments(track: Track, stream: Sequence[Frame]) -> Moments:
    return Moments.of(Judged.of(track, world_truth(stream)))


def _event(run_: Moments, beside: Moments, *near: float) -> Row:
    """A loss after an event; recovered when it is right by ``beside``, ``near`` (m, rad)."""
    return _loss(run_.after_alert(), trusted_before=False) | {
        "seconds": float(run_.seconds[-1] - run_.seconds[0]),
        "recovered_s": beside.recovered_s(0, *near),
        "right": bool(beside.right(*near)[-1]),
    }


def _spent(track: Track, k: int) -> Row:
    spent_ms = 1e3 * np.array(track.durations_s[k:])
    return {"ms": binned(spent_ms), "max_ms": float(spent_ms.max())}


def _loss(run_: Moments, *, trusted_before: bool) -> Row:
    hazardous = run_.hazardous()
    return {
        "scans": len(hazardous),
        "hazardous": int(hazardous.sum()),
        "denied": int((hazardous & ~run_.told).sum()),
        "stretches": stretches(hazardous),
        "hazardous_protected": int((hazardous & run_.protected()).sum()),
        "protected": int(run_.protected().sum()),
        "misleading": int(run_.misleading().sum()),
        "unavailable": int((~run_.trusted).sum()),
        "wrong_places": run_.wrong_places(trusted_before),
    }


def _drive(track: Track, stream: Sequence[Frame]) -> tuple[Row, Moments]:
    """What the run without an event comes to, and its scans."""
    judged = Judged.of(track, world_truth(stream))
    run_ = Moments.of(judged)
    drive = _loss(run_, trusted_before=True) | {
        "seconds": float(run_.seconds[-1] - run_.seconds[0]),
        "silent": judged.silent_share(),
        "ate": judged.ate(),
        "se2": judged.ate("se2"),
        "max_m": float(run_.off.max()),
        "outages": run_.outages(),
    }
    return drive | _spent(track, STEADY), run_
