# SPDX-License-Identifier: Apache-2.0
"""A square room of 8 x 8 m with one chair and one door, seen by an ideal scanner, made by hand."""

import math

import numpy as np

from scripts.comparison.recording import NOTHING, STATIC, Recording
from slam.frames import LaserSpec
from slam.system import Raster
from tests.world2d import frame_at

SPEC = LaserSpec(
    n_beams=361, angle_min=-math.pi / 2, angle_increment=math.radians(0.5), range_max=80.0
)
CHAIR, DOOR = 0, 1
NAMES, KINDS = ("chair1", "door1"), ("chair_visitor", "door")
RADII = np.array([0.1, 1.0])
HZ = 5
CELL_M = 0.05
WALL_M = 4.0


def chair_distance(angle: float, chair) -> float:
    """m from the origin along ``angle`` to a disc of 0.1 m at ``chair`` (x, y); inf past it."""
    along = chair[0] * math.cos(angle) + chair[1] * math.sin(angle)
    across = abs(chair[1] * math.cos(angle) - chair[0] * math.sin(angle))
    return along - math.sqrt(0.01 - across**2) if along > 0.0 and across < 0.1 else math.inf


def scan_of(chair) -> tuple[np.ndarray, np.ndarray]:
    """(ranges, hit) from the origin looking along +x: walls at 4 m, the chair, no door leaf."""
    ranges, hit = [], []
    for angle in SPEC.angles.tolist():
        c, s = abs(math.cos(angle)), abs(math.sin(angle))
        wall = min(WALL_M / max(c, 1e-9), WALL_M / max(s, 1e-9))
        to_chair = chair_distance(angle, chair)
        ranges.append(min(wall, to_chair))
        hit.append(CHAIR if to_chair < wall else STATIC)
    return np.array(ranges, dtype=np.float32), np.array(hit, dtype=np.int16)


def recording(chairs) -> Recording:
    """A robot at the origin, which does not move; ``chairs`` (n, 2) where the chair is at scans."""
    frames, hits, poses = [], [], []
    for k, chair in enumerate(chairs):
        stamp_ns = k * 1_000_000_000 // HZ
        ranges, hit = scan_of(chair)
        zero = np.zeros(3)
        frames.append(frame_at(stamp_ns, zero, ranges, SPEC, twist=zero, truth=zero))
        hits.append(hit)
        poses.append([[*chair, 0.0], [2.0, -3.0, math.pi / 2]])
    return Recording(
        frames=frames,
        hit=np.array(hits),
        poses=np.array(poses),
        moving=np.zeros((len(frames), 2), dtype=bool),
        names=NAMES,
        kinds=KINDS,
        radii_m=RADII,
        closed=np.array([[2.0, 0.0, 0.0], [2.0, -3.0, math.pi / 2]]),
        static_map=walls(),
        returns=np.array([NOTHING * 0, 90, 10, 0]),
    )


def walls() -> Raster:
    """The true map: a ring of occupied cells round 8 x 8 m."""
    return raster(lambda x, y: max(abs(x), abs(y)) > WALL_M)


def raster(occupied) -> Raster:
    """9 x 9 m about the origin, 1 where ``occupied(x, y)`` at a cell's centre, else 0."""
    n = round(9.0 / CELL_M)
    centres = [-4.5 + (k + 0.5) * CELL_M for k in range(n)]
    values = np.array([[float(occupied(x, y)) for x in centres] for y in centres])
    return Raster(
        values=values.astype(np.float32),
        resolution_m=CELL_M,
        T_map_origin=np.array([-4.5, -4.5, 0.0]),
    )
