# SPDX-License-Identifier: Apache-2.0
"""The second oracle: scan matching to the true map of what never moves. It is told no labels.

It shares no code with ``shunting`` but the geometry of a beam and of a pose. Where it holds, what
stands still tells where the robot is, whatever any SLAM makes of it. ``create("oracle(map)")``.

A likelihood field (Thrun, Burgard, Fox 2005, section 6.4): the distance of each end point from the
nearest wall, least squares with a kernel that lets go of what is far from all walls (Geman and
McClure 1987), from odometry's prior. A pose at which beams pass through walls is wrong, whoever
stands around: then it looks for one where they do not, first nearby (a robot that was turned by a
push), then everywhere (one that was carried).
"""

import math

import numpy as np
from scipy.ndimage import distance_transform_edt

from slam import se2
from slam._jit import njit
from slam.errors import InvalidValueError
from slam.estimate import Estimate, Raster
from slam.frames import Float, Frame, Odometry
from slam.frontend.deskew import end_points
from slam.path import OnPath, PosePath

KERNELS_M = (0.2, 0.1, 0.05)  # half weight at 0.64 of it; coarse to fine
STEPS = 4  # of Gauss and Newton with each kernel
SIGMA_M = 0.1  # of a distance to the map: neighbouring beams err alike, so each counts for less
FLOOR_M, FLOOR_RAD = 0.01, math.radians(0.3)  # least spread of odometry's prior a step
MOST_M = 1e3  # from the nearest wall, where there is none
ENOUGH = 20  # beams on walls; with fewer the pose is odometry's
ASSUMED = (0.05, 0.05, math.radians(3.0))  # spread of a step whose odometry states none, m, m, rad
DENIED = 0.1  # of the beams through walls, from which on a pose is wrong; at true ones 0.06 at most
AGAINST = 4.0  # points on walls that a beam through a wall outweighs
THROUGH_M = 0.2  # before its end, within which a beam may touch a wall
APART_M, APART_RAD = 0.2, math.radians(4.0)  # of the poses that a search tries
NEAR_M = 0.4  # from odometry's guess, to look first
BEAMS, BEST = 45, 20  # that a search looks at; poses of which it refines and compares
FOUND = (0.1, 0.1, math.radians(3.0))  # spread of a pose that a search proposes, m, m, rad


class MapOracle(OnPath):
    """A control, no contestant: it must be shown the true map (``know``) before the first frame.

    Raises ``InvalidValueError`` for frames without a scan or out of order, or without a map.
    """

    def __init__(self) -> None:
        self._field: tuple[Float, float, Float] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the path; the map stays."""
        self._before: Odometry | None = None
        self._T_map_robot: Float = np.zeros(3)
        self._spread: Float = np.zeros((3, 3))
        self._path = PosePath()

    def know(self, world: Raster, T_world_start: Float) -> None:
        """The true map of what never moves, in a world where the first frame is at that pose."""
        occupied = np.pad(world.values > 0.5, 1)
        outside = distance_transform_edt(~occupied) - 0.5  # cells, from centre to edge
        inside = distance_transform_edt(occupied) - 0.5
        metres = world.resolution_m * np.where(occupied, -inside, outside)
        if not occupied.any():  # walls that no beam meets: all poses are odometry's
            metres[:] = MOST_M
        corner = world.resolution_m * np.array([0.5, 0.5])  # of the padding, from its cell's centre
        origin = se2.compose(se2.inverse(T_world_start), world.T_map_origin)
        centre = se2.compose(origin, np.array([-corner[0], -corner[1], 0.0]))
        self._field = metres, world.resolution_m, se2.inverse(centre)

    def update(self, frame: Frame) -> Estimate:
        """Odometry's guess, then the pose nearby at which most of the scan lies on walls."""
        if frame.scan is None:
            raise InvalidValueError("oracle(map) needs a laser scan in every frame")
        if self._field is None:
            raise InvalidValueError(
                "oracle(map) needs the true map, which mobilia compare and benchmark show it"
            )
        self._path.check_order(frame.stamp_ns)
        pose, spread = self._predicted(frame.odometry)
        twist = frame.odometry.twist
        spec, valid = frame.scan.spec, frame.scan.valid
        points = end_points(
            frame.scan.ranges.astype(np.float64)[valid], spec.angles[valid],
            spec.beam_time_offsets[valid], spec.T_robot_laser,
            np.zeros(3) if twist is None else np.asarray(twist),
        )  # fmt: skip
        matched = self._matched(pose, spread, points)
        if self._denied(matched[0], points) > DENIED:
            matched = self._searched(pose, points) or matched
        self._T_map_robot, self._spread, walls = matched
        self._before = frame.odometry
        self._path.add(frame.stamp_ns, self._T_map_robot)
        return Estimate(
            stamp_ns=frame.stamp_ns, T_map_robot=self._T_map_robot, covariance=self._spread,
            converged=walls >= ENOUGH, diagnostics={"on_walls": walls},
        )  # fmt: skip

    def _predicted(self, now: Odometry) -> tuple[Float, Float]:
        """Pose and covariance (3, 3) by odometry."""
        if self._before is None:
            return self._T_map_robot, self._spread
        step = se2.between(self._before.T_odom_robot, now.T_odom_robot)
        stated = now.increment_covariance
        noise = np.diag(np.square(ASSUMED)) if stated is None else np.asarray(stated)
        noise = noise + np.diag([FLOOR_M**2, FLOOR_M**2, FLOOR_RAD**2])
        spread = se2.propagate(self._spread, self._T_map_robot, step, noise)
        return se2.compose(self._T_map_robot, step), spread

    def _matched(self, prior: Float, spread: Float, points: Float) -> tuple[Float, Float, int]:
        """Pose, covariance, and how many points lie on walls; the prior's where these are few."""
        if self._before is None or len(points) < ENOUGH:
            return prior, spread, len(points)
        sure, pose, told = np.linalg.inv(spread), prior, np.zeros((3, 3))
        walls = 0
        for kernel_m in KERNELS_M:
            for _ in range(STEPS):
                told, pull, walls = self._normal(pose, points, kernel_m)
                off = pose - prior
                off[2] = se2.wrap(float(off[2]))
                step = np.linalg.solve(told + sure, pull - (sure * off).sum(axis=1))
                pose = pose + step
        if walls < ENOUGH:
            return prior, spread, walls
        pose[2] = se2.wrap(float(pose[2]))
        found = np.linalg.inv(told + sure)
        return pose, 0.5 * (found + found.T), walls

    def _searched(self, prior: Float, points: Float) -> tuple[Float, Float, int] | None:
        """The pose that walls speak for the most, and hardly a beam against; None of none."""
        assert self._field is not None
        field, cell_m, T_field_map = self._field
        some = points[:: max(1, len(points) // BEAMS)]
        near = np.arange(-NEAR_M, NEAR_M + 1e-9, 0.5 * APART_M)
        around = prior[:2] + np.stack(np.meshgrid(near, near), axis=2).reshape(-1, 2)
        every = max(1, round(APART_M / cell_m))
        rows, columns = np.nonzero(field[::every, ::every] > APART_M)
        cells = cell_m * every * np.stack([columns, rows], axis=1).astype(np.float64)
        everywhere = se2.transform(se2.inverse(T_field_map), cells)
        for places, least in ((around, ENOUGH), (everywhere, len(points) / 2)):
            best, most = None, max(float(ENOUGH), least)
            for pose in self._likely(places, some) if len(places) else ():
                found = self._matched(pose, np.diag(np.square(FOUND)), points)
                through = self._denied(found[0], points)
                told = found[2] - AGAINST * through * len(points)
                if through <= 0.5 * DENIED and told > most:
                    best, most = found, told
            if best is not None:
                return best
        return None

    def _likely(self, places: Float, points: Float) -> Float:
        """(``BEST``, 3) poses, each of another heading, with the most points near walls."""
        assert self._field is not None
        field, cell_m, T_field_map = self._field
        at = se2.transform(T_field_map, places) / cell_m
        headings = np.arange(-math.pi, math.pi, APART_RAD)
        where, counts = np.empty(len(headings), dtype=np.int64), np.empty(len(headings))
        for k, heading in enumerate((headings + T_field_map[2]).tolist()):
            turned = se2.transform(np.array([0.0, 0.0, heading]), points) / cell_m
            where[k], counts[k] = _nearest_walls(field, at, turned)
        first = np.argsort(-counts, kind="stable")[:BEST]
        return np.column_stack([places[where[first]], headings[first]])

    def _metres(self, points_map: Float) -> Float:
        """(n,) m from each point to the nearest wall, negative within one; far outside the map."""
        assert self._field is not None
        field, cell_m, T_field_map = self._field
        column, row = np.rint(se2.transform(T_field_map, points_map) / cell_m).astype(np.int64).T
        known = (column >= 0) & (row >= 0) & (column < field.shape[1]) & (row < field.shape[0])
        return np.where(known, field[np.where(known, row, 0), np.where(known, column, 0)], MOST_M)

    def _denied(self, pose: Float, points: Float) -> float:
        """The share of points that lie behind a wall, seen from the robot."""
        far = np.sqrt((points * points).sum(axis=1))
        steps = np.arange(0.0, float(far.max(initial=0.0)), 0.05)[None, :]
        shares = steps / np.maximum(far, 1e-9)[:, None]
        along = (shares[:, :, None] * points[:, None, :]).reshape(-1, 2)
        inside = (self._metres(se2.transform(pose, along)) < 0.0).reshape(shares.shape)
        through = (inside & (steps < far[:, None] - THROUGH_M)).sum(axis=1) > 1
        return float(through.mean()) if len(points) >= ENOUGH else 0.0

    def _normal(self, pose: Float, points: Float, kernel_m: float) -> tuple[Float, Float, int]:
        """Normal equations (3, 3) and (3,) of the distances to walls, and how many are near."""
        assert self._field is not None
        field, cell_m, T_field_map = self._field
        at_map = se2.transform(pose, points)
        at = se2.transform(T_field_map, at_map) / cell_m
        column, row = np.floor(at).astype(np.int64).T
        known = (column >= 0) & (row >= 0) & (column < field.shape[1] - 1)
        known &= row < field.shape[0] - 1
        at, at_map, column, row = at[known], at_map[known], column[known], row[known]
        u, v = (at - np.stack([column, row], axis=1)).T
        a, b = field[row, column], field[row, column + 1]
        c, d = field[row + 1, column], field[row + 1, column + 1]
        far = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d)
        across = np.stack([(1 - v) * (b - a) + v * (d - c), (1 - u) * (c - a) + u * (d - b)], 1)
        slope = across / cell_m  # in the field's frame
        turn = -float(T_field_map[2])
        gx = math.cos(turn) * slope[:, 0] - math.sin(turn) * slope[:, 1]
        gy = math.sin(turn) * slope[:, 0] + math.cos(turn) * slope[:, 1]
        arm = at_map - pose[:2]
        lines = (gx, gy, gy * arm[:, 0] - gx * arm[:, 1])
        square = kernel_m * kernel_m
        weight = (square / (square + far * far)) ** 2 / SIGMA_M**2
        told = np.array([[(weight * p * q).sum() for q in lines] for p in lines])
        pull = -np.array([(weight * p * far).sum() for p in lines])
        return told, pull, int((np.abs(far) < kernel_m).sum())


@njit
def _nearest_walls(field: Float, places: Float, points: Float) -> tuple[int, int]:
    """Of (n, 2) cells the one from which most of (k, 2) points are near walls, and how many are."""
    best, most = 0, -1
    for k in range(len(places)):
        count = 0
        for i in range(len(points)):
            column = round(places[k, 0] + points[i, 0])
            row = round(places[k, 1] + points[i, 1])
            if 0 <= column < field.shape[1] and 0 <= row < field.shape[0]:
                count += abs(field[row, column]) < APART_M
        if count > most:
            best, most = k, count
    return best, most
