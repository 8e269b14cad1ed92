# SPDX-License-Identifier: Apache-2.0
"""A flat test world: walls, boxes and chairs that move, a scanner, a drive with worn wheels.

Small on purpose: it checks a SLAM against known motion, it does not judge fidelity (that is sim's).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slam import se2
from slam.frames import Frame, LaserSpec, Odometry, Scan, to_ns

Array = NDArray[np.float64]
TURN_S = 0.01332  # one mirror turn of an LMS-221


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Array:
    """(4, 4) segments x0 y0 x1 y1 of an axis-parallel box."""
    return np.array(
        [[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]], dtype=np.float64
    )


def laser(n_beams: int = 361, *, interlaced: bool = False, range_max: float = 80.0) -> LaserSpec:
    """180 degrees; ``interlaced``: even beams in the first mirror turn, odd ones in the second."""
    beams = np.arange(n_beams)
    offsets = np.zeros(n_beams)
    if interlaced:
        sweep = beams / (n_beams - 1) * TURN_S / 2.0
        offsets = sweep + (beams % 2) * TURN_S
    return LaserSpec(
        n_beams=n_beams,
        angle_min=-math.pi / 2.0,
        angle_increment=math.pi / (n_beams - 1),
        range_max=range_max,
        beam_time_offsets=offsets,
        T_robot_laser=np.array([0.1, 0.0, 0.0]),
    )


@dataclass(frozen=True)
class Chairs:
    """Chairs of five legs that rest, are pushed along a line, and rest again."""

    knots: Array  # (chairs, k) s
    places: Array  # (chairs, k, 2) m

    @classmethod
    def random(
        cls, count: int, area: Sequence[float], duration: float, moving: float, seed: int
    ) -> "Chairs":
        """``moving``: share of the time a chair is on its way; area x0, y0, x1, y1."""
        rng = np.random.default_rng(seed)
        k = 2 * math.ceil(duration / 2.0) + 4
        places = np.empty((count, k, 2))
        knots = np.empty((count, k))
        for c in range(count):
            t, place = -rng.uniform(0.0, 4.0), rng.uniform(area[:2], area[2:])
            for n in range(0, k, 2):
                knots[c, n], places[c, n] = t, place
                push = rng.uniform(1.0, 3.0)
                t += push * (1.0 / moving - 1.0) if moving > 0.0 else 2.0 * duration
                knots[c, n + 1], places[c, n + 1] = t, place
                heading, speed = rng.uniform(-math.pi, math.pi), rng.uniform(0.2, 0.8)
                step = push * speed * np.array([math.cos(heading), math.sin(heading)])
                place = np.clip(place + step, area[:2], area[2:])
                t += push
        return cls(knots, places)

    def discs(self, t: float) -> Array:
        """(n, 3) x, y, radius of all legs and posts."""
        legs = np.arange(5) * math.tau / 5.0
        star = np.vstack([0.28 * np.stack([np.cos(legs), np.sin(legs)], axis=1), [[0.0, 0.0]]])
        centres = np.array(
            [
                [np.interp(t, k, p[:, 0]), np.interp(t, k, p[:, 1])]
                for k, p in zip(self.knots, self.places, strict=True)
            ]
        ).reshape(-1, 2)
        points = (centres[:, None, :] + star[None, :, :]).reshape(-1, 2)
        return np.column_stack([points, np.full(len(points), 0.03)])


@dataclass(frozen=True)
class World2D:
    """Segments (n, 4) and chairs."""

    segments: Array
    chairs: Chairs | None = None

    def ranges(self, t: float, poses: Array, angles: Array, range_max: float) -> Array:
        """(n,) m by beam; ``poses`` (n, 3) T_world_laser of each beam, inf without a hit."""
        headings = poses[:, 2] + angles
        dx, dy = np.cos(headings)[:, None], np.sin(headings)[:, None]
        ox, oy = poses[:, 0][:, None], poses[:, 1][:, None]
        x0, y0, x1, y1 = (self.segments[:, k][None, :] for k in range(4))
        ex, ey = x1 - x0, y1 - y0
        cross = dx * ey - dy * ex
        with np.errstate(divide="ignore", invalid="ignore"):
            r = ((x0 - ox) * ey - (y0 - oy) * ex) / cross
            along = ((x0 - ox) * dy - (y0 - oy) * dx) / cross
        hit = (r > 0.0) & (along >= 0.0) & (along <= 1.0)
        nearest = np.where(hit, r, np.inf).min(axis=1)
        if self.chairs is not None:
            cx, cy, radius = (column[None, :] for column in self.chairs.discs(t).T)
            forward = (cx - ox) * dx + (cy - oy) * dy
            aside = (cx - ox) * dy - (cy - oy) * dx
            inside = radius**2 - aside**2
            r = forward - np.sqrt(np.maximum(inside, 0.0))
            nearest = np.minimum(
                nearest, np.where((inside > 0.0) & (r > 0.0), r, np.inf).min(axis=1)
            )
        nearest[nearest > range_max] = np.inf
        return nearest


@dataclass(frozen=True)
class Drive:
    """A start pose and pieces of constant body motion (v m/s, omega rad/s, s)."""

    start: tuple[float, float, float]
    pieces: tuple[tuple[float, float, float], ...]

    @property
    def duration(self) -> float:
        return sum(piece[2] for piece in self.pieces)

    def at(self, t: float) -> tuple[Array, Array]:
        """T_world_robot and body twist at time t."""
        pose = np.array(self.start)
        for v, omega, length in self.pieces:
            twist = np.array([v, 0.0, omega])
            if t <= length:
                return se2.compose(pose, se2.exp(twist, t)), twist
            pose = se2.compose(pose, se2.exp(twist, length))
            t -= length
        return pose, np.zeros(3)


@dataclass(frozen=True, kw_only=True)
class Wheels:
    """Odometry error: white per wheel (m per sqrt m), a scale and a left/right difference."""

    noise: float = 0.008
    scale_sd: float = 0.02
    difference_sd: float = 0.004
    base: float = 0.4


def frame_at(
    stamp_ns: int,
    odometry: ArrayLike = (0.0, 0.0, 0.0),
    ranges: ArrayLike | None = None,
    spec: LaserSpec | None = None,
    *,
    twist: ArrayLike | None = None,
    **more: Any,
) -> Frame:
    """One frame with odometry there, and a scan of those ranges if there are any."""
    wheels = Odometry(
        stamp_ns=stamp_ns,
        T_odom_robot=np.array(odometry, float),
        twist=None if twist is None else np.array(twist, float),
    )
    if ranges is not None:
        scanned = np.asarray(ranges, np.float32)
        more["scan"] = Scan(stamp_ns=stamp_ns, ranges=scanned, spec=spec or laser())
    return Frame(stamp_ns=stamp_ns, odometry=wheels, **more)


def frames(
    world: World2D,
    drive: Drive,
    *,
    rate_hz: float,
    spec: LaserSpec | Sequence[LaserSpec] | None = None,
    apart_s: float = 0.0,
    wheels: Wheels | None = None,
    seed: int = 0,
    noise_m: float = 0.01,
    with_covariance: bool = True,
) -> list[Frame]:
    """The drive as a robot would record it, truth attached.

    Of several scanners, each scans at that rate, ``apart_s`` after the one before it.
    """
    specs = [spec or laser()] if spec is None or isinstance(spec, LaserSpec) else spec
    wheels = wheels or Wheels()
    rng = np.random.default_rng(seed)
    scale = 1.0 + rng.normal(0.0, wheels.scale_sd)
    difference = rng.normal(0.0, wheels.difference_sd)
    out: list[Frame] = []
    odom, before = np.zeros(3), drive.at(0.0)[0]
    scans = math.floor(drive.duration * rate_hz) + 1
    for k, (which, spec) in product(range(scans), enumerate(specs)):
        t = k / rate_hz + which * apart_s
        pose, twist = drive.at(t)
        increment, covariance = rolled(
            se2.log(se2.between(before, pose)), wheels, scale, difference, rng
        )
        odom = se2.compose(odom, increment)
        if spec.sweep_duration > 0.0:  # over the sweep, which may straddle two pieces
            swept = se2.between(pose, drive.at(t + spec.sweep_duration)[0])
            twist = se2.log(swept) / spec.sweep_duration
        ranges = world.ranges(t, lasers_at(t, drive, spec), spec.angles, spec.range_max)
        ranges = np.maximum(ranges + rng.normal(0.0, noise_m, spec.n_beams), 0.0)
        stamp = to_ns(t)
        out.append(
            Frame(
                stamp_ns=stamp,
                odometry=Odometry(
                    stamp_ns=stamp,
                    T_odom_robot=odom,
                    increment_covariance=covariance if with_covariance else None,
                    twist=twist * scale,
                ),
                scan=Scan(stamp_ns=stamp, ranges=ranges.astype(np.float32), spec=spec),
                truth=pose,
            )
        )
        before = pose
    return out


def rolled(
    step: Array, wheels: Wheels, scale: float, difference: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """The increment that the encoders say of a true step (vx, vy, omega), and its covariance."""
    left = step[0] - 0.5 * wheels.base * step[2]
    right = step[0] + 0.5 * wheels.base * step[2]
    measured = [
        d * scale * (1.0 + side * difference) + rng.normal(0.0, wheels.noise) * abs(d) ** 0.5
        for d, side in ((left, -0.5), (right, 0.5))
    ]
    turn = (measured[1] - measured[0]) / wheels.base
    variance = wheels.noise**2
    forward = variance * (abs(left) + abs(right)) / 4.0 + (wheels.scale_sd * step[0]) ** 2
    heading = variance * (abs(left) + abs(right)) / wheels.base**2
    heading += (wheels.scale_sd * step[2]) ** 2
    heading += (wheels.difference_sd * step[0] / wheels.base) ** 2
    increment = se2.exp([0.5 * (measured[0] + measured[1]), 0.0, turn])
    return increment, np.diag([forward, 0.25 * step[0] ** 2 * heading, heading])


def lasers_at(t: float, drive: Drive, spec: LaserSpec) -> Array:
    """(n_beams, 3) pose of the laser at each beam of the scan from ``t`` on."""
    offsets, beam = np.unique(spec.beam_time_offsets, return_inverse=True)
    poses = [se2.compose(drive.at(t + offset)[0], spec.T_robot_laser) for offset in offsets]
    return np.array(poses)[beam]


def arena(phase: float = 0.25, cell: float = 0.03) -> Array:
    """10 x 8 m room about the origin, its walls at ``phase`` of a cell, a pillar in it."""
    off = phase * cell
    return np.vstack(
        [rectangle(-5.01 + off, -3.99 + off, 5.01 + off, 3.99 + off), rectangle(3.4, 1.5, 4.0, 2.1)]
    )


def office() -> Array:
    """24 x 14 m: a 2 m corridor round a block of rooms, with cabinets, niches and open doors."""
    walls = [rectangle(-1.013, -1.007, 23.004, 13.011)]
    # the inner block, with door gaps of 1 m at irregular places
    for gaps, (x0, y0, x1, y1) in (
        ((3.1, 11.6), (1.006, 1.012, 20.993, 1.012)),
        ((6.3, 15.2), (1.006, 10.996, 20.993, 10.996)),
        ((4.4,), (1.006, 1.012, 1.006, 10.996)),
        ((2.7,), (20.993, 1.012, 20.993, 10.996)),
    ):
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        edges = [0.0] + [e for g in gaps for e in (g, g + 1.0)] + [length]
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            walls.append(np.array([[x0 + a * ux, y0 + a * uy, x0 + b * ux, y0 + b * uy]]))
    walls.append(np.array([[11.0, 1.012, 11.0, 10.996], [1.006, 6.0, 20.993, 6.0]]))
    rng = np.random.default_rng(5)
    for _ in range(10):
        x, y = rng.uniform(2.0, 20.0), rng.uniform(2.0, 10.0)
        walls.append(rectangle(x, y, x + rng.uniform(0.3, 1.2), y + rng.uniform(0.3, 0.6)))
    for x in rng.uniform(0.0, 21.0, 8):
        walls.append(rectangle(x, -1.007, x + rng.uniform(0.4, 0.9), -0.75))
        walls.append(rectangle(x, 12.74, x + rng.uniform(0.4, 0.9), 13.011))
    return np.vstack(walls)


def office_loop(speed: float = 0.8) -> Drive:
    """Once round the corridor and a little further: 66 m."""
    corner = (0.4, 0.8, math.pi / 2.0 / 0.8)
    arc = 0.4 / 0.8
    pieces: list[tuple[float, float, float]] = []
    for length in (22.0, 12.0, 22.0, 12.0):
        pieces += [(speed, 0.0, (length - 2.0 * arc) / speed), corner]
    return Drive((arc, 0.0, 0.0), (*pieces, (speed, 0.0, 2.0 / speed)))


def wander(duration: float, speed: float = 0.4, turn: float = 0.4) -> Drive:
    """Circles to and fro inside the arena."""
    half = math.tau / turn
    piece, pieces = 0.0, []
    while piece < duration:
        pieces += [(speed, turn, half), (speed, -turn, half)]
        piece += 2.0 * half
    return Drive((0.0, 0.0, 0.0), tuple(pieces))


def going_on(stream: list[Frame], last: Frame, seconds: float = 0.2) -> list[Frame]:
    """The stream with stamps and odometry that go on from ``last`` as if nothing was."""
    out = []
    for frame in stream:
        stamp = last.stamp_ns + round(seconds * 1e9) + frame.stamp_ns
        T_odom_robot = se2.compose(last.odometry.T_odom_robot, frame.odometry.T_odom_robot)
        odometry = replace(frame.odometry, stamp_ns=stamp, T_odom_robot=T_odom_robot)
        assert frame.scan is not None
        scan = replace(frame.scan, stamp_ns=stamp)
        out.append(replace(frame, stamp_ns=stamp, odometry=odometry, scan=scan))
    return out
