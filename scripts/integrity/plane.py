# SPDX-License-Identifier: Apache-2.0
"""Streams of a small plane world, independent of the simulator of ``sim``: ``frames(spec)``.

Walls, chairs, boards and people are segments and discs; a robot drives through a building and looks
about with a scanner all of whose beams are measured at once, at the stamp: nothing is skewed. Its
only errors are noise, the end of its range, and beams without return. One spec gives the same
bytes each time, whatever else was simulated before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scripts.integrity.crew import BOARD, BOX, CHAIR, COAT, LEGS, Crew, Drive, Place
from scripts.integrity.driving import driven, odometry
from scripts.integrity.geometry import first_hits
from scripts.integrity.kinds import KINDS, StreamSpec
from scripts.integrity.layouts import Layout, layout
from scripts.integrity.movers import live
from scripts.integrity.things import outlines, things
from slam.frames import (
    BeamClass,
    BeamLabels,
    Float,
    Frame,
    LaserSpec,
    Odometry,
    Scan,
    to_ns,
)

__all__ = ["KINDS", "StreamSpec", "World", "frames", "world"]

LONGEST_STEP_S = 0.02
RANGE_MIN_M = 0.05
_DISCS = {CHAIR: 4, LEGS: 2, COAT: 1}


@dataclass(frozen=True, eq=False)
class World:
    """A stream before it is looked at.

    layout  the building
    robot   (n, 3) true poses at the scans, m and rad
    things  what moves; ``poses`` (n, m, 3) and ``moving`` (n, m) at the scans
    """

    layout: Layout
    robot: Float
    things: Crew
    poses: Float
    moving: NDArray[np.bool_]


def world(spec: StreamSpec) -> World:
    """The building of a spec, and all ways in it."""
    settings = spec.settings
    building = layout(settings.layout, spec.rng("layout"))
    every = math.ceil(1.0 / settings.rate_hz / LONGEST_STEP_S - 1e-9)
    dt = 1.0 / settings.rate_hz / every
    scans = round(spec.seconds * settings.rate_hz)
    path = driven(building, scans * every * dt, dt, spec.rng("driving"))[: scans * every]
    place = Place(building.rooms, building.walls, building.pillars)
    crew = things(spec, place, path[0])
    poses = np.zeros((scans, len(crew.kinds), 3))
    moving = np.zeros((scans, len(crew.kinds)), dtype=np.bool_)
    drive = Drive(path, dt, math.radians(settings.fov_deg))
    live(crew, drive, place, settings.moved_every_s, every, poses, moving)
    return World(building, path[::every], crew, poses, moving)


def frames(spec: StreamSpec) -> list[Frame]:
    """What a robot of a spec gets to know, with truth and labels."""
    settings, known = spec.settings, world(spec)
    laser = _laser(spec)
    rng = spec.rng("lidar")
    ranges, hits = _looked(known, laser)
    noisy = ranges + settings.sigma_m * rng.standard_normal(ranges.shape)
    gone = (noisy > settings.range_max_m) | (rng.random(ranges.shape) < settings.dropouts)
    noisy = np.where(gone, np.inf, np.maximum(noisy, RANGE_MIN_M))
    hits = np.where(gone, -2, hits)
    poses, stated = odometry(known.robot, settings.odometry, spec.rng("odometry"))
    out = []
    for k, truth in enumerate(known.robot):
        stamp = to_ns(k / settings.rate_hz)
        out.append(
            Frame(
                stamp_ns=stamp,
                odometry=Odometry(
                    stamp_ns=stamp, T_odom_robot=poses[k], increment_covariance=stated[k]
                ),
                scan=Scan(stamp_ns=stamp, ranges=noisy[k].astype(np.float32), spec=laser),
                truth=truth,
                labels=_labels(hits[k], known.moving[k]),
            )
        )
    return out


def _laser(spec: StreamSpec) -> LaserSpec:
    settings = spec.settings
    fov = math.radians(settings.fov_deg)
    return LaserSpec(
        n_beams=settings.beams,
        angle_min=-0.5 * fov,
        angle_increment=fov / (settings.beams - 1),
        range_min=RANGE_MIN_M,
        range_max=settings.range_max_m,
        range_sigma_m=settings.sigma_m,
    )


def _looked(known: World, laser: LaserSpec) -> tuple[Float, Float]:
    """(n, beams) true ranges, m, and what each beam hits: a thing, -1 the building, -2 nothing."""
    building, movable = known.layout, known.things
    n_walls, n_pillars = len(building.walls), len(building.pillars)
    sides = 4 * int(np.isin(movable.kinds, (BOX, BOARD)).sum())
    round_ = sum(count * int((movable.kinds == kind).sum()) for kind, count in _DISCS.items())
    segments, of_segment = np.zeros((sides + n_walls, 4)), np.full(sides + n_walls, -1.0)
    discs, of_disc = np.zeros((round_ + n_pillars, 3)), np.full(round_ + n_pillars, -1.0)
    segments[sides:], discs[round_:] = building.walls, building.pillars
    ranges = np.zeros((len(known.robot), laser.n_beams))
    hits = np.zeros_like(ranges)
    for k, pose in enumerate(known.robot):
        outlines(
            known.poses[k], movable.kinds, movable.traits, segments, of_segment, discs, of_disc
        )
        first_hits(
            pose, laser.angles, segments, of_segment, discs, of_disc, ranges[k], hits[k]
        )  # fmt: skip
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
        body=np.where(thing == -2, -1, np.where(movable, thing + 1, 0)),
        kind=kind,
        displacement=np.zeros(len(hit), dtype=np.float32),
        incidence=np.full(len(hit), np.nan, dtype=np.float32),
        mixed=np.zeros(len(hit), dtype=np.bool_),
    )
