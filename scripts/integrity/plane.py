# SPDX-License-Identifier: Apache-2.0
"""Streams of a small plane world, independent of the simulator of ``sim``: ``frames(spec)``.

Walls, chairs, boards and people are segments and discs; a robot drives through a building and looks
about with a scanner all of whose beams are measured at once, at the stamp: nothing is skewed. Its
only errors are noise, the end of its range, and beams without return. One spec gives the same
bytes each time, whatever else was simulated before.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scripts.integrity import things
from scripts.integrity.driving import driven, odometry
from scripts.integrity.geometry import first_hits
from scripts.integrity.kinds import KINDS, StreamSpec
from scripts.integrity.layouts import Layout, layout
from scripts.integrity.movers import live, may_stand
from scripts.integrity.things import AROUND_M, BOX, DISCS, LEGS, SIDES, Plane, Things
from slam.frames import BeamClass, BeamLabels, Float, Frame, LaserSpec, Odometry, Scan, to_ns

__all__ = ["KINDS", "StreamSpec", "World", "frames", "world"]

LONGEST_STEP_S = 0.02
RANGE_MIN_M = 0.05
TRIES = 400


@dataclass(frozen=True, eq=False)
class World:
    """A stream before it is looked at.

    layout  the building
    robot   (n, 3) true poses at the scans, m and rad
    things  what moves; ``poses`` (n, m, 3) and ``moving`` (n, m) at the scans
    """

    layout: Layout
    robot: Float
    things: Things
    poses: Float
    moving: NDArray[np.bool_]


def world(spec: StreamSpec) -> World:
    """The building of a spec, and all ways in it."""
    kind = spec.settings
    building = layout(kind.layout, spec.rng("layout"))
    every = math.ceil(1.0 / kind.rate_hz / LONGEST_STEP_S - 1e-9)
    dt = 1.0 / kind.rate_hz / every
    scans = round(spec.seconds * kind.rate_hz)
    path = driven(building, scans * every * dt, dt, spec.rng("driving"))[: scans * every]
    rngs = {part: spec.rng(part) for part in ("chairs", "boards", "people")}
    plane = Plane(
        things.traits(kind, rngs["chairs"], rngs["boards"]), building.rooms, building.walls,
        building.pillars, path, dt, math.radians(kind.fov_deg),
    )  # fmt: skip
    _place(plane, rngs)
    poses = np.zeros((scans, len(plane.things), 3))
    moving = np.zeros((scans, len(plane.things)), dtype=np.bool_)
    live(plane, kind.moved_every_s, every, poses, moving)
    return World(building, path[::every], plane.things, poses, moving)


def _place(plane: Plane, rngs: dict[str, np.random.Generator]) -> None:
    """Put each thing where it may stand, drawn of the generator of its part."""
    for i, thing in enumerate(plane.things):
        kind = thing["kind"]
        rng = rngs["chairs" if kind <= BOX else "people" if kind >= LEGS else "boards"]
        escorts = kind >= LEGS and thing["follows"] == 1.0
        drawn = _around(plane.path[0], rng) if escorts else _in_rooms(plane.rooms, rng)
        for pose in itertools.islice(drawn, TRIES):
            if may_stand(plane, i, pose):
                thing["x"], thing["y"], thing["a"] = pose
                break
        thing["state"] = rng.integers(0, 2**63, dtype=np.uint64)
    plane.things["seen"][plane.things["follows"] == 1.0] = 0.0


def _in_rooms(rooms: Float, rng: np.random.Generator) -> Iterator[Float]:
    """Poses in the rooms, by their areas."""
    areas = (rooms[:, 2] - rooms[:, 0]) * (rooms[:, 3] - rooms[:, 1])
    shares = np.cumsum(areas / areas.sum())
    while True:
        x0, y0, x1, y1 = rooms[min(int(np.searchsorted(shares, rng.random())), len(rooms) - 1)]
        yield np.array([rng.uniform(x0, x1), rng.uniform(y0, y1), rng.uniform(0.0, math.tau)])


def _around(robot: Float, rng: np.random.Generator) -> Iterator[Float]:
    """Poses about the robot, ever farther from it."""
    for n in itertools.count():
        away, bearing = rng.uniform(*AROUND_M) + 0.01 * n, rng.uniform(0.0, math.tau)
        yield robot + np.array([away * math.cos(bearing), away * math.sin(bearing), bearing])


def frames(spec: StreamSpec) -> list[Frame]:
    """What a robot of a spec gets to know, with truth and labels."""
    kind, known = spec.settings, world(spec)
    laser, rng = _laser(spec), spec.rng("lidar")
    ranges, hits = _looked(known, laser)
    noisy = ranges + kind.sigma_m * rng.standard_normal(ranges.shape)
    gone = (noisy > kind.range_max_m) | (rng.random(ranges.shape) < kind.dropouts)
    noisy = np.where(gone, np.inf, np.maximum(noisy, RANGE_MIN_M))
    hits = np.where(gone, -2, hits)
    poses, stated = odometry(known.robot, kind.odometry, spec.rng("odometry"))
    out = []
    for k, truth in enumerate(known.robot):
        stamp = to_ns(k / kind.rate_hz)
        wheels = Odometry(stamp_ns=stamp, T_odom_robot=poses[k], increment_covariance=stated[k])
        scan = Scan(stamp_ns=stamp, ranges=noisy[k].astype(np.float32), spec=laser)
        labels = _labels(hits[k], known.moving[k])
        out.append(Frame(stamp_ns=stamp, odometry=wheels, scan=scan, truth=truth, labels=labels))
    return out


def _laser(spec: StreamSpec) -> LaserSpec:
    kind = spec.settings
    fov = math.radians(kind.fov_deg)
    return LaserSpec(
        n_beams=kind.beams, angle_min=-0.5 * fov, angle_increment=fov / (kind.beams - 1),
        range_min=RANGE_MIN_M, range_max=kind.range_max_m, range_sigma_m=kind.sigma_m,
    )  # fmt: skip


def _looked(known: World, laser: LaserSpec) -> tuple[Float, Float]:
    """(n, beams) true ranges, m, and what each beam hits: a thing, -1 the building, -2 nothing."""
    kinds = known.things["kind"].tolist()
    sides, round_ = (sum(of.get(kind, 0) for kind in kinds) for of in (SIDES, DISCS))
    walls, pillars = known.layout.walls, known.layout.pillars
    segments = np.full((sides + len(walls), 5), -1.0)
    discs = np.full((round_ + len(pillars), 4), -1.0)
    segments[sides:, :4], discs[round_:, :3] = walls, pillars
    ranges = np.zeros((len(known.robot), laser.n_beams))
    hits = np.zeros_like(ranges)
    for k, pose in enumerate(known.robot):
        things.outlines(known.poses[k], known.things, segments, discs)
        first_hits(pose, laser.angles, segments, discs, ranges[k], hits[k])
    return ranges, hits


def _labels(hit: Float, moving: NDArray[np.bool_]) -> BeamLabels:
    """Truth of each beam; how far a thing was displaced and under which angle it is hit is not
    kept: 0 and NaN."""
    thing = hit.astype(np.int32)
    kind = np.full(len(hit), BeamClass.STATIC, dtype=np.uint8)
    kind[thing == -2] = BeamClass.NONE
    movable = thing >= 0
    kind[movable] = np.where(moving[thing[movable]], BeamClass.MOVING, BeamClass.SEMI_STATIC)
    return BeamLabels(
        body=np.where(thing == -2, -1, np.where(movable, thing + 1, 0)), kind=kind,
        displacement=np.zeros(len(hit), dtype=np.float32),
        incidence=np.full(len(hit), np.nan, dtype=np.float32),
        mixed=np.zeros(len(hit), dtype=np.bool_),
    )  # fmt: skip
