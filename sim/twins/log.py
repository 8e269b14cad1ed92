# SPDX-License-Identifier: Apache-2.0
"""A log driven again in a built scene: its poses, its times, its scanner, odometry like its own.

Walls move to where the returns of the log lie: each face of a box by the median of its beams along
its normal, and with many beams the wall turns a little. Then each scan moves to where the walls
are, as the poses of a log err by centimetres, too; and so on in turn.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.scanner import Band, Scanner
from sim.world.labels import BeamLabeller
from sim.world.world import SUBSTEPS_PER_S, SUBSTEPS_PER_TICK, World
from slam import se2
from slam._jit import inner, njit
from slam.frames import NS_PER_S, Float, Frame, LaserSpec, Odometry, Scan

ROUNDS = 4
NEAR_M = 0.25  # a return farther from a face is of something else
LEAST = 6  # beams on a face, to move it
MOST_M = 0.15  # that a face moves in one round
THIN_M = 0.02  # thickness that is left of a wall, at least
OBLIQUE = 0.17  # cosine of incidence; more oblique beams place a face badly
POSE_NEAR_M, POSE_LEAST = 0.15, 20  # returns that put a pose right: how near to a face, how many
POSE_HOLDS, POSE_MOST = 5.0, (0.05, 0.05, 0.01)  # returns that a pose weighs; m, m, rad of a round
TURN_LEAST, TURN_SPAN_M, TURN_MOST = 40, 1.0, 0.03  # beams, m along a face, rad, to turn a wall


def laid(boxes: Float, lasers: Float, ranges: Float, angles: Float) -> tuple[Float, Float]:
    """(n, 5) boxes, cx, cy, half sizes m and yaw rad, as the scans see them; poses of the scanner.

    lasers  (k, 3) poses of the scanner, which are put right by the walls a little, in turn
    ranges  (k, b) m, NaN for none;  angles  (b,) rad
    """
    out, poses = np.array(boxes, dtype=np.float64), np.array(lasers, dtype=np.float64)
    for _ in range(ROUNDS if len(out) else 0):
        seen = _residuals(out, poses, ranges, angles)
        keys = seen.rows * 4 + seen.faces
        order = np.argsort(keys, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
            if len(part) >= LEAST:
                first = part[0]
                face = int(seen.faces[first])
                _move(out[seen.rows[first]], face, seen.inward[part], seen.along[part])
        _put_right(poses, _residuals(out, poses, ranges, angles))
    return np.round(out, 4), np.round(poses, 6)


def _put_right(poses: Float, seen: "Seen") -> None:
    """Move each pose to where its returns lie on the faces: one step of least squares, bounded."""
    near = np.abs(seen.inward) < POSE_NEAR_M
    for k in range(len(poses)):
        own = near & (seen.scans == k)
        if own.sum() < POSE_LEAST:
            continue
        normal, arm = seen.normals[own], seen.points[own] - poses[k, :2]
        by_turn = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
        by = np.column_stack([normal, by_turn])
        weight = np.eye(3) * [POSE_HOLDS, POSE_HOLDS, POSE_HOLDS * 10.0]
        step = np.linalg.solve(by.T @ by + weight, by.T @ seen.inward[own])
        poses[k] += np.clip(step, -np.array(POSE_MOST), POSE_MOST)


def _move(box: Float, face: int, inward: Float, along: Float) -> None:
    """Move one face of a box inward by the median, and turn the box by the slope of the rest."""
    axis, sign = face // 2, 1.0 if face % 2 else -1.0
    by = float(np.clip(np.median(inward), -MOST_M, MOST_M))
    half = box[2 + axis]
    by = min(by, 2.0 * half - THIN_M)
    box[2 + axis] = half - 0.5 * by
    c, s = math.cos(box[4]), math.sin(box[4])
    normal = (c, s) if axis == 0 else (-s, c)
    box[0] -= 0.5 * sign * by * normal[0]
    box[1] -= 0.5 * sign * by * normal[1]
    if len(inward) < TURN_LEAST or np.ptp(along) < TURN_SPAN_M or box[3 - axis] < half:
        return
    middle = along - along.mean()
    slope = float((middle * (inward - inward.mean())).sum() / (middle * middle).sum())
    turn = -sign * slope if axis == 1 else sign * slope
    box[4] += 0.5 * min(max(turn, -TURN_MOST), TURN_MOST)


@inner
def _entered(box: Float, x: float, y: float, heading: float) -> tuple[float, int]:
    """m to where a ray enters a box, and the face, -u, +u, -v, +v; (-1, 0) where it does not."""
    c, s = math.cos(box[4]), math.sin(box[4])
    ox, oy = x - box[0], y - box[1]
    dx, dy = math.cos(heading), math.sin(heading)
    at = (c * ox + s * oy, -s * ox + c * oy)
    way = (c * dx + s * dy, -s * dx + c * dy)
    near, far, face = -1e9, 1e9, 0
    for axis in range(2):
        half = box[2 + axis]
        if abs(way[axis]) < 1e-9:
            if abs(at[axis]) > half:
                return -1.0, 0
            continue
        a, b = (-half - at[axis]) / way[axis], (half - at[axis]) / way[axis]
        if min(a, b) > near:
            near, face = min(a, b), 2 * axis + (0 if way[axis] > 0.0 else 1)
        far = min(far, max(a, b))
    return (near, face) if 0.0 < near < far else (-1.0, 0)


@inner
def _hit(
    boxes: Float, reach: Float, x: float, y: float, heading: float, most: float
) -> tuple[int, int, float]:
    """The first box that a ray enters within ``most`` m, the face and m to it; -1 for none."""
    found, side, best = -1, 0, most
    dx, dy = math.cos(heading), math.sin(heading)
    for j in range(boxes.shape[0]):
        ox, oy = x - boxes[j, 0], y - boxes[j, 1]
        ahead = -(ox * dx + oy * dy)
        passes = abs(ox * dy - oy * dx) > reach[j]
        if passes or ahead < -reach[j] or ahead - reach[j] > best:
            continue
        near, face = _entered(boxes[j], x, y, heading)
        if 0.0 < near < best:
            found, side, best = j, face, near
    return found, side, best


class Seen(NamedTuple):
    """Beams that end near a face: scan, box, face (-u, +u, -v, +v), m inward, m along it.

    normals, points  (n, 2) out of the face; where the return lies
    """

    scans: NDArray[np.int64]
    rows: NDArray[np.int64]
    faces: NDArray[np.int64]
    inward: Float
    along: Float
    normals: Float
    points: Float


@njit
def _residuals(boxes: Float, lasers: Float, ranges: Float, angles: Float) -> Seen:
    """Every beam that ends near the face it meets."""
    n, count = ranges.size, 0
    which = np.empty((3, n), dtype=np.int64)
    values = np.empty((n, 6))
    reach = np.sqrt(boxes[:, 2] ** 2 + boxes[:, 3] ** 2)
    for k in range(lasers.shape[0]):
        x, y, heading = lasers[k]
        for b in range(ranges.shape[1]):
            r, way = ranges[k, b], heading + angles[b]
            if math.isnan(r):
                continue
            found, side, best = _hit(boxes, reach, x, y, way, r + NEAR_M / OBLIQUE)
            if found < 0:
                continue
            turned = way - boxes[found, 4]
            square = abs(math.cos(turned)) if side < 2 else abs(math.sin(turned))
            deeper = (r - best) * square
            if square < OBLIQUE or abs(deeper) > NEAR_M:
                continue
            px, py = x + r * math.cos(way), y + r * math.sin(way)
            dx, dy = px - boxes[found, 0], py - boxes[found, 1]
            c, s = math.cos(boxes[found, 4]), math.sin(boxes[found, 4])
            out = 1.0 if side % 2 else -1.0
            which[0, count], which[1, count], which[2, count] = k, found, side
            values[count, 0], values[count, 4], values[count, 5] = deeper, px, py
            if side < 2:
                values[count, 1] = -s * dx + c * dy
                values[count, 2], values[count, 3] = out * c, out * s
            else:
                values[count, 1] = c * dx + s * dy
                values[count, 2], values[count, 3] = -out * s, out * c
            count += 1
    which, values = which[:, :count].copy(), values[:count].copy()
    return Seen(
        which[0], which[1], which[2], values[:, 0], values[:, 1], values[:, 2:4], values[:, 4:]
    )


SWEEP_HZ = 75.0  # scans of a second: a mirror turn of a SICK LMS; the robot stands meanwhile
MOST_BETWEEN_S = 5.0  # that a room lives between two scans; a longer pause of a log is cut


def scanner_like(spec: LaserSpec, sigma_m: float, unit_m: float = 0.0) -> Scanner:
    """A scanner with the beams, field of view and range of a log, and that noise."""
    return Scanner(
        name="log",
        first_deg=math.degrees(spec.angle_min),
        step_deg=math.degrees(spec.angle_increment),
        n_beams=spec.n_beams,
        rate_hz=SWEEP_HZ,
        range_min_m=spec.range_min,
        range_max_m=min(spec.range_max, 1000.0),
        unit_m=unit_m,
        noise=(Band(up_to_m=1000.0, error_m=sigma_m),) if sigma_m > 0.0 else (),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """The way of a log: stamps ns, and (n, 3) poses and odometry in m, m, rad."""

    stamps_ns: NDArray[np.int64]
    poses: Float
    odometry: Float


class LogTwin:
    """A scene through which the robot is carried along the way of a log.

    scene     built, with its crowd if there is to be one
    spec      of the log's scans; scans here are as those, all beams at once
    rates     how much moves; None: nothing, and the scans are of the scene at rest
    """

    def __init__(
        self,
        scene: Scene,
        drive: Drive,
        spec: LaserSpec,
        scanner: Scanner,
        *,
        seed: int = 0,
        rates: Dynamism | None = None,
    ) -> None:
        seeds = Seeds(seed)
        self._lives = rates is not None
        self.world = World(scene, seed=seeds, dynamism=rates or 0.0)
        self._drive, self._spec = drive, spec
        self._robot = int(self.world.model.joint("robot/x").qposadr[0])
        self._speed = int(self.world.model.joint("robot/x").dofadr[0])
        model = self.world.model
        own = np.array(
            [model.body(b).name.startswith("robot/") for b in model.geom_bodyid.tolist()]
        )
        model.geom_contype[own] = model.geom_conaffinity[own] = 0  # it goes where the log went
        x, y, yaw = spec.T_robot_laser.tolist()
        site = model.site("robot/laser").id
        model.site_pos[site, :2] = x, y
        model.site_quat[site] = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)
        self._laser = LaserScanner(model, scanner, seeds.generator("lidar"))
        self._labeller = BeamLabeller(self.world)

    def frames(self) -> Iterator[Frame]:
        """One for each scan of the log."""
        drive, before = self._drive, None
        for stamp_ns, pose, wheels in zip(
            drive.stamps_ns.tolist(), drive.poses, drive.odometry, strict=True
        ):
            if before is not None and self._lives:
                self._live(before[1], pose, (stamp_ns - before[0]) / NS_PER_S)
            before = (stamp_ns, pose)
            self._put(pose)
            result = self._laser.observe(lambda at=pose: self._put(at), self.world.data)  # type: ignore[misc]
            yield Frame(
                stamp_ns=stamp_ns,
                odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=wheels),
                scan=Scan(stamp_ns=stamp_ns, ranges=result.ranges, spec=self._spec),
                truth=se2.compose(pose, np.zeros(3)),
                labels=self._labeller.label(result),
            )

    def _put(self, pose: Sequence[float] | Float) -> None:
        data = self.world.data
        data.qpos[self._robot : self._robot + 3] = pose
        data.qvel[self._speed : self._speed + 3] = 0.0
        mujoco.mj_kinematics(self.world.model, data)

    def _live(self, first: Float, last: Float, seconds: float) -> None:
        """Let the room live while the robot is carried from pose to pose."""
        tick = SUBSTEPS_PER_TICK / SUBSTEPS_PER_S
        ticks = max(1, round(min(max(seconds, 0.0), MOST_BETWEEN_S) / tick))
        for k in range(ticks):
            self._put(se2.interpolate(first, last, (k + 1) / ticks))
            mujoco.mj_step1(self.world.model, self.world.data)
            for _ in range(SUBSTEPS_PER_TICK):
                self.world.substep()
