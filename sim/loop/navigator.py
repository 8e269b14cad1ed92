# SPDX-License-Identifier: Apache-2.0
"""From what a SLAM believes to the next command; knows goals, plan, scans and wheels, no truth.

The way is the grid's (``sim.driving.navgrid``), the steering the driver's (``sim.driving.drive``):
the same two that drive recorded episodes, there by truth. The grid is the scene's static layout, or
the map that the SLAM has so far, in the world frame, reached through the known start.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenes.scene import Scene
from sim.actors.config import DRIVE
from sim.driving.drive import Driver, TourConfig
from sim.driving.navgrid import NavGrid
from sim.loop.sight import Sight
from slam import se2
from slam.frames import NS_PER_S, Float, Frame
from slam.settings import Settings, number, word
from slam.system import Estimate, Raster

MARGIN_M = 1.0  # of floor round what is known
OCCUPIED = 0.5  # cells of a map above this are walls
# A pose estimate may be wrong by this before a wall of the layout stops a robot whose scanner sees
# the floor free.
SLACK_M = 0.15
_KEPT_BACK_M = 0.05  # planned ways come this much nearer to walls than the driver does


@dataclass(frozen=True, kw_only=True)
class LoopConfig(Settings):
    """What counts as what, and how often things are done.

    Ways are planned on the scene's static ``layout``, or on the SLAM's ``map``.
    """

    plan_on: str = word("layout", ("layout", "map"), "what ways are planned on")
    scans: int = number(4, "scans", "to one update and one command: 9.4 Hz", low=1, high=100)
    arrive_m: float = number(0.1, "m", "so near it believes to have arrived", low=1e-6, high=10.0)
    tolerance_m: float = number(0.5, "m", "so near it truly has", low=1e-6, high=10.0)
    patience_s: float = number(
        20.0, "s", "without believed progress: a goal is given up", low=1e-6, high=1e4
    )
    limit_s: float = number(90.0, "s", "after which it is in any case", low=1e-6, high=1e4)
    replan_s: float = number(
        1.0, "s", "between two plans, round what is seen standing in the way", low=1e-6, high=1e4
    )
    near_m: float = number(
        0.15, "m", "between rims of a person and the robot: a near miss", low=1e-6, high=10.0
    )


class LayoutPlanner:
    """Walls and furniture as the architect drew them."""

    def __init__(self, scene: Scene, tour: TourConfig) -> None:
        xmin, ymin, xmax, ymax = scene.bounds
        bounds = (xmin - MARGIN_M, ymin - MARGIN_M, xmax + MARGIN_M, ymax + MARGIN_M)
        self._grid = NavGrid(bounds, scene.obstacles, tour.robot_radius_m - _KEPT_BACK_M)
        self._walls = self._grid.with_boxes(np.zeros((0, 5)))
        self._walls.clearance += SLACK_M

    def grids(self, raster: Raster | None, places: Float) -> tuple[NavGrid, NavGrid]:
        """The plan, and the walls that stop the robot whatever it sees.

        The SLAM's map, and the ``places`` that must be on the plan, do not matter here.
        """
        return self._grid, self._walls


class MapPlanner:
    """The SLAM's own map; what it has not seen counts as free."""

    def __init__(self, T_world_map: Float, tour: TourConfig) -> None:
        self._T_world_map, self._radius = T_world_map, tour.robot_radius_m - _KEPT_BACK_M

    def grids(self, raster: Raster | None, places: Float) -> tuple[NavGrid, NavGrid]:
        """The plan on the map as it is, and no walls: only what is seen stops the robot.

        ``places`` (n, 2) m must lie on it.
        """
        corners = places
        boxes = np.zeros((0, 5))
        if raster is not None and raster.values.size:
            boxes = self._boxes(raster)
            corners = np.concatenate([places, boxes[:, :2]])
        low, high = corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M
        bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
        plan = NavGrid(bounds, boxes, self._radius)
        return plan, NavGrid(bounds, np.zeros((0, 5)), self._radius)

    def _boxes(self, raster: Raster) -> Float:
        """(n, 5) occupied cells as boxes in the world."""
        rows, columns = np.nonzero(np.nan_to_num(raster.values) > OCCUPIED)
        step = raster.resolution_m
        cells = np.column_stack([(columns + 0.5) * step, (rows + 0.5) * step])
        T_world_raster = se2.compose(self._T_world_map, raster.T_map_origin)
        boxes = np.empty((len(cells), 5))
        boxes[:, :2] = se2.transform(T_world_raster, cells)
        boxes[:, 2:4] = 0.5 * step
        boxes[:, 4] = T_world_raster[2]
        return boxes


_FAR = 1e6
PROGRESS_M = 0.25  # less than this nearer is no progress
CLOSE_M, CLOSE_S = 0.4, 4.0  # this near without progress for this long: as near as one gets
SLOWEST_MPS, CREEP_M = 0.15, 0.1  # towards a goal: speed, and how far it looks ahead
DOUBT_SPEED = 0.5  # share of the usual speed while the SLAM does not trust itself
DOUBT_S, LOOK_S, LOOK_RADPS = 1.5, 12.0, 0.6  # then it stops and looks about, at most so long
TIGHT_M = 0.2  # thin things are planned round this closely where there is no way otherwise


@dataclass(frozen=True, kw_only=True)
class Decision:
    """(v m/s, omega rad/s), and why the goal is over: "arrived", why it is given up, or ""."""

    v: float = 0.0
    omega: float = 0.0
    over: str = ""


class Navigator:
    """Steers to one goal after another.

    start  (3,) T_world_map: where the robot was at the first frame, which it was told
    """

    def __init__(self, scene: Scene, start: Float, config: LoopConfig) -> None:
        self.config, self._start = config, start
        self._tour = TourConfig(goal_radius_m=0.5 * config.arrive_m, patience_s=8.0)
        self._planner: LayoutPlanner | MapPlanner = (
            LayoutPlanner(scene, self._tour)
            if config.plan_on == "layout"
            else MapPlanner(start, self._tour)
        )
        self._sight = Sight()
        self._goal: Float = start[:2]
        self._driver: Driver | None = None
        self._layout: NavGrid | None = None
        self._doubt_s = 0.0
        self._stamp_ns: int | None = None

    def aim(self, goal: Float) -> None:
        """Go to (x, y) m in the world from now on."""
        self._goal = np.asarray(goal, dtype=np.float64)
        self._driver, self._layout, self._open = None, None, True
        self._since_s, self._planned_s, self._idle_s = 0.0, -math.inf, 0.0
        self._best = self._left = math.inf

    def believed(self, estimate: Estimate) -> Float:
        """(3,) T_world_robot by the SLAM."""
        return se2.compose(self._start, estimate.T_map_robot)

    def decide(
        self, frame: Frame, estimate: Estimate, raster: Callable[[], Raster | None], lag_s: float
    ) -> Decision:
        """What to do from now on.

        raster  asked for when a way is planned on the map
        lag_s   how long ago the frame's stamp is
        """
        dt = 0.0 if self._stamp_ns is None else (frame.stamp_ns - self._stamp_ns) / NS_PER_S
        self._stamp_ns = frame.stamp_ns
        self._since_s += dt
        self._sight.take(frame)
        there = self.believed(estimate)
        here = self._now(there, frame, lag_s)
        self._doubt_s = 0.0 if estimate.converged else self._doubt_s + dt
        distance = math.hypot(there[0] - self._goal[0], there[1] - self._goal[1])
        if estimate.converged and distance < self.config.arrive_m:
            return Decision(over="arrived")
        if self._since_s - self._planned_s >= self.config.replan_s:
            self._plan(here, raster)
        over = self._progress(here, distance, dt, trusted=estimate.converged)
        if over:
            return Decision(over=over)
        if DOUBT_S < self._doubt_s < DOUBT_S + LOOK_S:
            return Decision(omega=LOOK_RADPS)
        v, omega = self._steer(here, frame, dt, distance)
        share = 1.0 if estimate.converged else DOUBT_SPEED
        return Decision(v=share * v, omega=share * omega)

    def _now(self, there: Float, frame: Frame, lag_s: float) -> Float:
        """The believed pose, carried on over ``lag_s`` by what the wheels did last."""
        twist = frame.odometry.twist
        return there if twist is None else se2.compose(there, se2.exp(twist, lag_s))

    def _plan(self, here: Float, raster: Callable[[], Raster | None]) -> None:
        """Ways round what stands there; if there is none, ways as if nothing did."""
        self._planned_s = self._since_s
        seen = raster() if isinstance(self._planner, MapPlanner) else None
        layout, walls = self._planner.grids(seen, np.array([here[:2], self._goal]))
        left = layout.cost_near(layout.cost_to(self._goal), here[0], here[1])
        self._open = left < _FAR
        if left > self._left + PROGRESS_M:  # the map has grown: the way is longer than thought
            self._best = left
        self._layout = layout
        grid = self._round(layout, here)
        if self._driver is None:
            self._driver = Driver(walls, self._goal[None], self._tour)
        self._driver.use(grid, walls=walls, afresh=False)

    def _round(self, layout: NavGrid, here: Float) -> NavGrid:
        """The layout with what is seen on it: at its full size, tighter, or not at all, whichever
        first leaves a way."""
        points, radii = self._sight.points_robot, self._sight.radii
        boxes = np.zeros((len(points), 5))
        boxes[:, :2] = se2.transform(here, points)
        for largest in (math.inf, TIGHT_M):
            boxes[:, 2] = boxes[:, 3] = np.minimum(radii, largest)
            grid = layout.with_boxes(boxes)
            if grid.cost_near(grid.cost_to(self._goal), here[0], here[1]) < _FAR:
                return grid
        return layout

    def _progress(self, here: Float, distance: float, dt: float, *, trusted: bool) -> str:
        """Why the goal is over now, or ""."""
        layout = self._layout
        assert layout is not None  # planned before
        self._left = layout.cost_near(layout.cost_to(self._goal), here[0], here[1])
        if self._left < self._best - PROGRESS_M:
            self._best, self._idle_s = self._left, 0.0
        else:
            self._idle_s += dt
        if self._idle_s >= CLOSE_S and trusted and distance < CLOSE_M:
            return "arrived"
        if not self._open and self._idle_s >= CLOSE_S:
            return "no way"
        if self._idle_s >= self.config.patience_s:
            return "no progress"
        return "time" if self._since_s >= self.config.limit_s else ""

    def _steer(self, here: Float, frame: Frame, dt: float, distance: float) -> tuple[float, float]:
        """(v, omega) of the driver among what is seen, slower the nearer the goal."""
        points = self._sight.points_robot
        discs = np.zeros((len(points), 5))
        discs[:, :2] = se2.transform(here, points)
        discs[:, 2] = self._sight.radii
        twist = frame.odometry.twist
        velocity = (0.0, 0.0) if twist is None else (float(twist[0]), float(twist[2]))
        # What it stands too near to already may be driven away from, not nearer to.
        offset = discs[:, :2] - here[:2]
        room = np.sqrt(offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1])
        discs[:, 2] = np.minimum(discs[:, 2], room - self._tour.robot_radius_m)
        assert self._driver is not None  # made with the first plan
        self._driver.look_ahead_m = min(DRIVE.look_ahead_m, max(CREEP_M, distance - CREEP_M))
        v, omega = self._driver.command(here, velocity, discs, dt)
        share = min(1.0, max(SLOWEST_MPS, distance) / max(abs(v), 1e-9))
        return share * v, share * omega
