# SPDX-License-Identifier: Apache-2.0
"""Who drives in a recorded episode: a tour of the scene's rooms, avoiding what truly is there.

Reactive avoidance on truth is what recording needs: the path must not depend on any SLAM. A closed
loop steers ``sim.driving.drive.Driver`` with an estimate instead.
"""

import math

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import kind_of
from sim.actors.config import DRIVE
from sim.driving.drive import Driver, TourConfig, tour, tour_at
from sim.driving.navgrid import NavGrid
from sim.world.robots import Robot
from sim.world.world import World
from slam import se2
from slam._jit import njit
from slam.frames import NS_PER_S, Float

BODY, DOOR, ROBOT = 0, 1, 2
PARTS = 3  # discs of what is long: its middle and its two ends
SPARE_M = 0.005  # of the clearance beyond the footprint
LEAP_M = 0.5  # m beyond what the wheels can do; a robot that got so far was carried
LEAP_MPS = 10.0  # m/s; what is faster was put there by hand (``sim.actors.rearranging``)


def tour_of(robot: Robot | None) -> TourConfig:
    """How a robot drives round a room, None the scenes' own: at its pace, but not above the usual.

    Its clearance is that of the disc about its axle that holds its footprint.
    """
    if robot is None:
        return TourConfig()
    return tour_at(robot.drive, round(robot.radius + abs(robot.ahead_m) + SPARE_M, 9))


class Pilot:
    """Drives a world's robot round the scene's goals; draws only from the "driving" stream.

    keep_out  (n, 3) poses like ``World.mover_poses`` that are avoided too, though nothing is there
    """

    def __init__(
        self, world: World, config: TourConfig | None = None, *, keep_out: Float | None = None
    ) -> None:
        self.world = world
        scene = world.scene
        config = config or tour_of(world.robot)
        self._doors = np.array([m.group == "door" for m in scene.movers], dtype=np.bool_)
        self._closed = world.bodies.hinges([m.name for m in scene.movers if m.group == "door"])[
            :, 2
        ]
        number = {"door": DOOR, "robot": ROBOT}
        self._kinds = np.array([number.get(m.group, BODY) for m in scene.movers], dtype=np.int64)
        self._radii = np.array([m.radius for m in scene.movers], dtype=np.float64)
        halves = [kind_of(m.kind).half_length_m for m in scene.movers]
        self._halves = np.array(halves, dtype=np.float64)
        self._planned_ns = world.time_ns
        self._leaves_planned = self._open_leaves(world.mover_poses())
        goals = tour(scene.goals, world.seeds.generator("driving"))
        self._walls = NavGrid(scene.bounds, scene.obstacles, config.robot_radius_m - 0.05)
        self.driver = Driver(self._walls, goals, config)
        self.driver.use(self._walls.with_boxes(self._leaves_planned))
        self._ghosts = np.zeros((0, 5))
        if keep_out is not None:
            self._ghosts = self._discs(keep_out, keep_out, np.zeros(3), math.inf, 1.0)
        self._last: Float | None = None
        self._here: Float | None = None
        self._since, self._decided = 0.0, (0.0, 0.0)

    def command(self, dt: float) -> tuple[float, float]:
        """(v m/s, omega rad/s) for the next ``dt`` s, from where everything truly is now."""
        self._since += dt
        if self._last is not None and self._since < DRIVE.decide_s:
            return self._decided
        dt, self._since = self._since, 0.0
        poses = self.world.mover_poses()
        before, self._last = self._last, poses
        self._replan(poses)
        here = self.world.robot_pose()
        velocity = self._velocity(here, dt)
        before = poses if before is None else before
        discs = self._discs(poses, before, here, DRIVE.sight_m, dt)
        if len(self._ghosts):
            gap = self._ghosts[:, :2] - here[:2]
            near = gap[:, 0] * gap[:, 0] + gap[:, 1] * gap[:, 1] < DRIVE.sight_m * DRIVE.sight_m
            discs = np.concatenate([discs, self._ghosts[near]])
        self._decided = self.driver.command(here, velocity, discs, dt)
        return self._decided

    def _discs(self, poses: Float, before: Float, here: Float, sight: float, dt: float) -> Float:
        sizes = (self._radii, self._halves)
        return _surroundings(poses, before, self._kinds, sizes, here, sight, dt)

    def _replan(self, poses: Float) -> None:
        """Plan again when a leaf stands elsewhere by more than about 20 degrees."""
        if self.world.time_ns - self._planned_ns < DRIVE.replan_s * NS_PER_S:
            return
        self._planned_ns = self.world.time_ns
        leaves = self._open_leaves(poses)
        if len(leaves) == len(self._leaves_planned):
            turned = se2.wrap_array(leaves[:, 4] - self._leaves_planned[:, 4])
            if not (np.abs(turned) > 0.35).any():
                return
        self._leaves_planned = leaves
        self.driver.use(self._walls.with_boxes(leaves))

    def _open_leaves(self, poses: Float) -> Float:
        """(k, 5) boxes of the leaves that stand open."""
        rows = []
        doors = np.column_stack([poses, self._radii])[self._doors]
        for (x, y, yaw, width), closed in zip(doors.tolist(), self._closed.tolist(), strict=True):
            if abs(se2.wrap(yaw - closed)) > DRIVE.ajar_rad:
                half = 0.5 * width
                cx, cy = x + half * math.cos(yaw), y + half * math.sin(yaw)
                rows.append((cx, cy, half, DRIVE.leaf_m, yaw))
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def _velocity(self, here: Float, dt: float) -> tuple[float, float]:
        """(v m/s, omega rad/s) since the last call; at rest at the first."""
        before, self._here = self._here, here
        if before is None:
            return 0.0, 0.0
        x, y, turned = se2.between(before, here).tolist()
        if math.hypot(x, y) > self.world.drive_config.v_max * dt + LEAP_M:  # it was carried there
            return 0.0, 0.0
        return math.copysign(math.hypot(x, y), x) / dt, turned / dt


@njit
def _surroundings(  # noqa: PLR0913 (kernel)
    poses: Float,
    before: Float,
    kinds: NDArray[np.int64],
    sizes: tuple[Float, Float],
    here: Float,
    sight: float,
    dt: float,
) -> Float:
    """(k, 5) discs in sight: x, y, radius (m), velocity (m/s) of movers.

    Six along each leaf, three along what is long.
    """
    radii, halves = sizes
    discs = np.empty((len(poses) * DRIVE.leaf_discs, 5))
    count = 0
    for k in range(len(poses)):
        if kinds[k] == ROBOT:
            continue
        parts = PARTS if halves[k] > 0.0 else 1
        if kinds[k] == DOOR:
            parts = DRIVE.leaf_discs
        for part in range(parts):
            x, y, radius, vx, vy = poses[k, 0], poses[k, 1], radii[k], 0.0, 0.0
            if kinds[k] == DOOR:
                reach = radii[k] * (part + 1) / DRIVE.leaf_discs
                x += reach * math.cos(poses[k, 2])
                y += reach * math.sin(poses[k, 2])
                radius = DRIVE.leaf_m
            else:
                bx, by = before[k, 0], before[k, 1]
                if parts == PARTS:
                    reach = halves[k] * (part - 1)
                    x += reach * math.cos(poses[k, 2])
                    y += reach * math.sin(poses[k, 2])
                    bx += reach * math.cos(before[k, 2])
                    by += reach * math.sin(before[k, 2])
                vx, vy = (x - bx) / dt, (y - by) / dt
                if vx * vx + vy * vy > LEAP_MPS * LEAP_MPS:
                    vx, vy = 0.0, 0.0
            dx, dy = x - here[0], y - here[1]
            if dx * dx + dy * dy < sight * sight:
                discs[count, 0], discs[count, 1], discs[count, 2] = x, y, radius
                discs[count, 3], discs[count, 4] = vx, vy
                count += 1
    return discs[:count]
