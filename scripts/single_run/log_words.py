# SPDX-License-Identifier: Apache-2.0
"""What is said of a log: how it was read, how its scanner is mounted, why a run is not trusted."""

import logging
import math
from collections.abc import Sequence

import numpy as np

from scripts.console import say
from scripts.film.footage import Footage
from scripts.options import place_of
from slam.days.session import searched
from slam.errors import InvalidValueError, MobiliaError
from slam.frames import Float, StreamMetadata
from slam.logs.mounting import Mounting
from slam.logs.repairs import STANDS_STILL, WORDS
from slam.logs.rover import NAMES
from slam.replay import Track

UNTRUSTED = 1.0 / 3.0  # share of scans: more, and nobody should build on the run
UNTRUSTED_STATUS = 6  # exit status with --strict
MOST_USUAL_M = 100.0  # median range; more: they are in mm, or in cm
SURE = 0.99  # probability from which on a mounting is named as the one
_log = logging.getLogger(__name__)


class UntrustedRunError(MobiliaError):
    """More than ``UNTRUSTED`` of the scans are not trusted, and --strict was given."""

    status = UNTRUSTED_STATUS


def mount_of(text: str) -> Float:
    """``--laser 0.1,0,180`` as (3,) m, m, rad."""
    x, y, yaw_deg = place_of(text, "--laser")
    return np.array([x, y, math.radians(yaw_deg)])


def tell(footage: Footage, *, strict: bool) -> list[Mounting]:
    """Say what the log holds, and where its scanner is not known to be mounted as it was read.

    Returns what ``MountingTest`` found of the scanner that its scans contradict, else of the first.
    Raises ``InvalidValueError`` with ``strict`` where there is one.
    """
    metadata = footage.stream.metadata
    say(understood(footage), highlight=False)
    if words := units(footage):
        _log.warning("%s: %s", footage.title, words)
    if not metadata.odometry:
        return []
    told: list[Mounting] = []
    for one in (metadata, *metadata.others):
        if one.laser is None:
            continue
        found = footage.tested[one.laser.mount].told()
        words, wrong = doubt(one, found), _elsewhere(found)
        of = f"{footage.title}, {one.extra.get('scan')}" if metadata.others else footage.title
        if words and strict and wrong:
            raise InvalidValueError(f"{of}: {words} (refused by --strict)")
        if words:
            _log.warning("%s: %s", of, words)
        told = found if wrong or not told else told
    return told


def _elsewhere(found: Sequence[Mounting]) -> bool:
    """Whether scans agree under another mounting alone."""
    return bool(found) and not found[0].as_read and found[0].probability > SURE


def understood(footage: Footage) -> str:
    """Topic or format, beams, field of view, rate, direction, and where the scanner is."""
    stream, metadata = footage.stream, footage.stream.metadata
    count = footage.scans or stream.length or 0
    rate = (count - 1) / footage.duration_s if footage.duration_s > 0.0 else 0.0
    extra = metadata.extra
    of = str(extra.get("scan") or extra.get("message") or "features")
    echoes = f" ({extra['echoes']})" if "echoes" in extra else ""
    parts = [f"{metadata.source}, {of}{echoes}"]
    beams, place = _scanner(metadata)
    parts += [beams, f"{count} scans at {rate:.3g} Hz", place]
    parts += [f"{one.extra.get('scan')}, {', '.join(_scanner(one))}" for one in metadata.others]
    if names := extra.get("ignored", {}).get(NAMES):
        parts.append(
            f"{names} {NAMES if names > 1 else NAMES.replace('lines', 'line')} passed over"
        )
    odometry = str(extra.get("odometry") or "none")
    parts.append(f"odometry: {odometry if metadata.odometry else 'none'}")
    named = {one.extra.get("scan") for one in metadata.others}
    if passed := [name for name in extra.get("passed_over", ()) if name not in named]:
        parts.append(f"passed over (--scan, --odometry): {', '.join(passed)}")
    return f"{footage.title}: {'; '.join(filter(None, parts))}."


def _scanner(metadata: StreamMetadata) -> tuple[str, str]:
    """Its beams, and where it is on the robot; "" for a stream without one."""
    laser = metadata.laser
    if laser is None:
        return "", ""
    fov = math.degrees(laser.angles[-1] - laser.angles[0])
    turned = metadata.extra.get("turned", "counter-clockwise")
    by = f"by {metadata.mounting}" if metadata.mounting else "assumed"
    return (
        f"{laser.n_beams} beams over {fov:.0f}° ({turned}), up to {laser.range_max:.3g} m",
        f"scanner at {_place(laser.T_robot_laser)} on the robot, {by}",
    )


def units(footage: Footage) -> str:
    """What to say of ranges that cannot be in m; "" where they can."""
    if footage.usual_m <= MOST_USUAL_M:
        return ""
    laser = footage.stream.metadata.laser
    limit = f" (range_max is {laser.range_max:g})" if laser else ""
    return (
        f"ranges look like mm: the median is {footage.usual_m:.0f}{limit}; they must be in m: "
        "correct the driver, or divide by 1000"
    )


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
            f"to 5° ({_odds(found)}, {_cm(best)} apart). If it is not at the robot's centre, say "
            f"where: --laser x,y,{flags(metadata, best).rpartition(',')[2]}"
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


def tell_distrust(
    track: Track, footage: Footage, found: Sequence[Mounting], *, strict: bool
) -> None:
    """Warn of a run that nobody should build on; ``UntrustedRunError`` with ``strict``."""
    words = distrust(track, footage, found)
    if words and strict:
        raise UntrustedRunError(words)
    if words:
        _log.warning("%s", words)


def distrust(track: Track, footage: Footage, found: Sequence[Mounting]) -> str:
    """What to say where more than ``UNTRUSTED`` of the scans are not trusted; "" where fewer are.

    The causes come in the order of their likelihood: what the log itself gives away first.
    """
    told_apart = track.estimates[searched(track.estimates) :]  # what was looked for is no doubt
    share = float(np.mean([not one.converged for one in told_apart]))
    if share <= UNTRUSTED:
        return ""
    causes: list[str] = []
    rest: list[str] = []
    metadata = footage.stream.metadata
    stands = bool(metadata.extra.get(STANDS_STILL))
    causes += filter(None, ("its odometry stands still while scans move" * stands, units(footage)))
    if _elsewhere(found):
        causes.append(f"the scanner is mounted otherwise: {flags(metadata, found[0])}")
    elif not found or found[0].probability <= SURE or not metadata.mounting:
        rest.append("a wrong mounting (--laser x,y,yaw_deg, --flip)")
    if footage.empty > UNTRUSTED:
        causes.append(f"{footage.empty:.0%} of the scans return less than 10 % of beams")
        if not units(footage):
            rest.append("ranges in mm, all beyond range_max")
    repaired = [key for key in WORDS if metadata.extra.get(key)]
    if any("stamp" in key or "clock" in key for key in repaired):
        causes.append("the times of the log, which had to be repaired")
    else:
        rest.append("scans and odometry on different clocks")
    if not metadata.odometry and not stands:
        causes.append("the log has no odometry")
    if metadata.odometry:
        rest.append("wheels that slip, or odometry in other units")
    rest.append("a robot that was carried, or a room that moves as a whole")
    told = "; ".join([*causes, *rest])
    return f"{track.name} did not trust {share:.0%} of its scans. Likely causes, in order: {told}."
