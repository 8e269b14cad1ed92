# SPDX-License-Identifier: Apache-2.0
"""A room at rest through which a robot is carried along a recorded drive (``sim.twins.twins``)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.kinds import kind_of
from sim.moments import Moment
from sim.sensors.lidar.device import LaserScanner
from sim.world.labels import BeamLabeller
from sim.world.world import World
from slam._jit import njit
from slam.frames import Float, Frame, Odometry, Scan

UNSEEN_S = 1.0  # s out of sight before a mover may be found elsewhere
LOOK_S = 0.25  # s between two looks at what may be moved
MOVED_M, TURNED_RAD = 0.05, 0.15  # less is no displacement
MARGIN_M = 0.02  # m between the robot's rim and a mover
LEAF_M = 0.05  # half thickness of a door
_HULLS = np.array([1, 1, 1, 0, 1, 0], dtype=np.uint8)  # geom groups a ray sees


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A recorded drive through the dynamic version, of n scans.

    stamps_ns, truths  n each: of the frames that were observed
    path    n times (rows, 3) m, m, rad: the robot at each physics step of each scan
    before  n each: the row at which the world stood when the scan was begun
    qpos    (n, nq) of everything at the start of each scan
    rests   (n, movers) whether it rested then
    """

    stamps_ns: list[int]
    truths: list[Float]
    path: list[Float]
    before: list[int]
    qpos: Float
    rests: NDArray[np.bool_]


@njit
def gap(path: Float, pose: Float, length: float) -> float:
    """m from the nearest point of a path (n, 3) to a place, or to a leaf of ``length`` there."""
    nearest = math.inf
    ex, ey = math.cos(pose[2]), math.sin(pose[2])
    for k in range(path.shape[0]):
        dx, dy = path[k, 0] - pose[0], path[k, 1] - pose[1]
        along = min(max(dx * ex + dy * ey, 0.0), length)
        dx, dy = dx - along * ex, dy - along * ey
        nearest = min(nearest, dx * dx + dy * dy)
    return math.sqrt(nearest)


class _Shapes:
    """Discs, leaves and long things among the movers of a world, without its robot."""

    def __init__(self, world: World, path: Sequence[Float]) -> None:
        movers, radius = world.scene.movers, world.bodies.radius
        doors = np.array([m.group == "door" for m in movers], dtype=np.bool_)
        self.rows = [k for k, m in enumerate(movers) if m.group != "robot"]
        self._doors = doors
        self._back = np.array([kind_of(m.kind).half_length_m for m in movers], dtype=np.float64)
        self.length = np.where(doors, radius, 2.0 * self._back)
        self.radius = np.where(doors, LEAF_M, radius)
        robot = world.bodies.robot
        self._robot = MARGIN_M + (0.0 if robot is None else float(radius[robot]))
        self._path = np.ascontiguousarray(np.concatenate(path)[::3])

    def clear(self, row: int, pose: Float) -> bool:
        """Whether the whole path passes mover ``row`` if it stands at ``pose``."""
        free = gap(self._path, self._end(row, pose), float(self.length[row]))
        return free > self._robot + float(self.radius[row])

    def apart(self, row: int, pose: Float, poses: Float) -> bool:
        """Whether mover ``row`` at ``pose`` overlaps none of the others."""
        points = self.points(row, pose)
        for other in self.rows:
            reach = float(self.radius[row] + self.radius[other])
            # Two leaves never meet: each has its own doorway.
            if other == row or (self._doors[row] and self._doors[other]):
                continue
            if gap(points, self._end(other, poses[other]), float(self.length[other])) < reach:
                return False
        return True

    def _end(self, row: int, pose: Float) -> Float:
        """Where the middle line of a mover begins: its hinge, its middle, or a long one's end."""
        if self._back[row] == 0.0:
            return pose
        c, s = math.cos(float(pose[2])), math.sin(float(pose[2]))
        back = float(self._back[row])
        return np.array([pose[0] - back * c, pose[1] - back * s, pose[2]])

    def points(self, row: int, pose: Float) -> Float:
        """(k, 3) points of the mover's middle line."""
        length = float(self.length[row])
        steps = np.linspace(0.0, length, 6 if length > 0.0 else 1)
        out = np.tile(self._end(row, pose), (len(steps), 1))
        out[:, 0] += steps * math.cos(float(pose[2]))
        out[:, 1] += steps * math.sin(float(pose[2]))
        return out


class TwinRoom:
    """A room at rest through which the robot is carried."""

    def __init__(self, world: World, laser: LaserScanner, drive: Drive, *, labels: bool) -> None:
        self.world, self._laser, self._drive = world, laser, drive
        self._labeller = BeamLabeller(world) if labels else None
        self._robot = int(world.model.joint("robot/x").qposadr[0])
        self._site = int(world.model.site("robot/laser").id)
        self._body = int(world.model.body("robot/base").id)
        self._shapes = _Shapes(world, drive.path)
        self._unseen = np.full(len(world.scene.movers), math.inf)  # s
        self._steps: Iterator[Float] = iter(())
        self._put(drive.path[0][0])

    def _put(self, pose: Float) -> None:
        self.world.data.qpos[self._robot : self._robot + 3] = pose
        mujoco.mj_kinematics(self.world.model, self.world.data)

    def crosses(self) -> list[str]:
        """Names of movers that the path would run into as they stand now."""
        poses = self.world.mover_poses()
        return [
            self.world.scene.movers[k].name
            for k in self._shapes.rows
            if not self._shapes.clear(k, poses[k])
        ]

    def moments(self, odometry: list[Odometry], *, moved: bool) -> Iterator[Moment]:
        """All of them; with ``moved`` things are displaced while out of sight."""
        resting = np.zeros(len(self.world.scene.movers), dtype=np.bool_)
        period = float(self._laser.scanner.period_s)
        for k, path in enumerate(self._drive.path):
            present = self._drive.before[k]
            self._put(path[present])
            if moved and k % round(LOOK_S / period) == 0:
                self._displace(k)
            poses = self.world.mover_poses()
            self._steps = iter(path[present + 1 :])
            result = self._laser.observe(lambda: self._put(next(self._steps)), self.world.data)
            movers = self.world.bodies.mover_of_body[result.bodies[result.bodies >= 0]]
            self._unseen += period
            self._unseen[np.unique(movers[movers >= 0])] = 0.0
            stamp_ns = odometry[k].stamp_ns
            frame = Frame(
                stamp_ns=stamp_ns,
                odometry=odometry[k],
                scan=Scan(stamp_ns=stamp_ns, ranges=result.ranges, spec=self._laser.spec),
                truth=self._drive.truths[k],
                labels=self._labeller.label(result) if self._labeller else None,
            )
            yield Moment(frame=frame, poses=poses, moving=resting)

    def _displace(self, k: int) -> None:
        """Move what is out of sight to where it rests in the dynamic version at scan ``k``."""
        world, qpos = self.world, self._drive.qpos[k]
        now = world.mover_poses()
        then = world.bodies.poses_of(qpos)
        moved = False
        for row in self._shapes.rows:
            change = np.abs(then[row] - now[row])
            if max(change[:2]) < MOVED_M and change[2] < TURNED_RAD:
                continue
            if not (self._drive.rests[k, row] and self._unseen[row] > UNSEEN_S):
                continue
            if (
                self._shapes.clear(row, then[row])
                and self._shapes.apart(row, then[row], now)
                and not self._visible(row, then[row])
            ):
                world.bodies.copy_mover(row, qpos, world.data.qpos)
                now[row], moved = then[row], True
        if moved:
            world.people.stand(world.data)
            mujoco.mj_kinematics(world.model, world.data)

    def _visible(self, row: int, pose: Float) -> bool:
        """Whether the laser sees that place now: the way to a point of its outline is free."""
        model, data = self.world.model, self.world.data
        laser = data.site_xpos[self._site].copy()
        heading = data.site_xmat[self._site].reshape(3, 3)[:2, 0]
        radius = float(self._shapes.radius[row])
        hit = np.zeros(1, dtype=np.int32)
        for point in self._shapes.points(row, pose):
            for a in range(9):
                reach = radius if a < 8 else 0.0
                dx = float(point[0]) + reach * math.cos(0.25 * math.pi * a) - float(laser[0])
                dy = float(point[1]) + reach * math.sin(0.25 * math.pi * a) - float(laser[1])
                far = math.hypot(dx, dy)
                if far > 1e-6 and dx * heading[0] + dy * heading[1] < -0.1 * far:
                    continue
                free = mujoco.mj_ray(
                    model, data, laser, np.array([dx, dy, 0.0]), _HULLS, 1, self._body, hit
                )
                if free < 0.0 or free > 0.98:
                    return True
        return False
