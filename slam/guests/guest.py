# SPDX-License-Identifier: Apache-2.0
"""What guests share: bookkeeping, de-skewed points, the odometry guess, and a planar scan as the
matchers of others take it: in space, as ranges, against which kept scans.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.estimate import Estimate
from slam.frames import Float, Frame, LaserSpec, Odometry
from slam.frontend.config import FRONTEND, FrontendConfig
from slam.frontend.observations import from_scan
from slam.frontend.odometry_prior import Prediction, predict
from slam.path import OnPath, PosePath
from slam.settings import Settings

S = TypeVar("S", bound=Settings)
SPACING_AT_M = 10.0  # m; there a voxel is as wide as two beams are apart
LEAST_VOXEL_M = 0.10  # m
MOST_VOXEL_M = 0.30  # m
KEEP_M = 0.2  # m, a scan is kept after so much way: Karto's minimum travel distance
KEEP_RAD = math.radians(10.0)  # or turn: Karto's minimum travel heading
MOST_BEAMS = 4000  # Karto's matcher takes seconds a scan for as many
NOTHING_M = 1e3  # a range that Karto's matcher takes for no return
BASE = 20  # scans, the most that are matched against at once
NEAR_M = 8.0  # m, from the predicted pose; as for Karto's matcher


def lifted(pose: Float) -> Float:
    """(4, 4) of a planar pose."""
    c, s = math.cos(float(pose[2])), math.sin(float(pose[2]))
    out = np.eye(4)
    out[:2, :2] = [[c, -s], [s, c]]
    out[:2, 3] = pose[:2]
    return out


def flattened(matrix: Float) -> Float:
    """(3,) planar part of a (4, 4): x m, y m, yaw rad."""
    return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])


def voxel_m(spacing_rad: float) -> float:
    """Edge of a voxel, m: the beams' spacing at ``SPACING_AT_M``, within bounds."""
    return min(max(SPACING_AT_M * spacing_rad, LEAST_VOXEL_M), MOST_VOXEL_M)


def stacked(points: Float, apart_m: float) -> Float:
    """(3 n, 3) m: the points (n, 2) m in three layers, ``apart_m`` above each other.

    The points of one layer lie in one plane, so that every normal would point up. Of three, the
    normals are those of upright walls.
    """
    n = len(points)
    out = np.empty((3 * n, 3))
    for k, z in enumerate((-apart_m, 0.0, apart_m)):
        out[k * n : (k + 1) * n, :2] = points
        out[k * n : (k + 1) * n, 2] = z
    return out


def ranges_of(points_robot: Float, spec: LaserSpec, nothing_m: float) -> Float:
    """(n_beams,) m: the nearest end point (n, 2) along each beam; ``nothing_m`` for none.

    Of de-skewed points it is the scan of a scanner that stood still.
    """
    x, y = se2.transform(se2.inverse(spec.T_robot_laser), points_robot).T
    ranges = np.full(spec.n_beams, nothing_m)
    turned = np.array([math.atan2(b, a) for a, b in zip(x.tolist(), y.tolist(), strict=True)])
    beams = np.floor((turned - spec.angle_min) / spec.angle_increment + 0.5).astype(np.int64)
    inside = (beams >= 0) & (beams < spec.n_beams)
    np.minimum.at(ranges, beams[inside], np.sqrt(x * x + y * y)[inside])
    return ranges


def moved_on(before: Float, now: Float, keep_m: float = KEEP_M) -> bool:
    """Whether a pose (3,) is far enough, or turned enough, from the last scan kept to keep its."""
    x, y, turn = se2.between(before, now).tolist()
    return bool(math.hypot(x, y) > keep_m or abs(turn) > KEEP_RAD)


def check_beams(who: object, spec: LaserSpec, most: int = MOST_BEAMS) -> None:
    """``InvalidValueError`` for a scanner of more beams than a guest takes."""
    if spec.n_beams > most:
        raise InvalidValueError(
            f"{type(who).__name__} takes scanners of up to {most} beams, got {spec.n_beams}"
        )


def nearest(places: list[Float], pose: Float) -> list[int]:
    """The scans kept nearest to a pose (3,), nearest first; the last one where none is near."""
    apart = np.array(places)[:, :2] - pose[:2]
    squares = (apart * apart).sum(axis=1)
    order = np.argsort(squares, kind="stable")[:BASE]
    return [int(k) for k in order if squares[k] < NEAR_M**2] or [len(places) - 1]


@dataclass(frozen=True)
class _Grain:
    """Guests get the very points that "shunting" sees with its defaults."""

    cell_m: float = 0.03
    range_m: float = 40.0
    frontend: FrontendConfig = FRONTEND


_GRAIN = _Grain()


def configured(kind: type[S], given: S | Mapping[str, Any] | None) -> S:
    """A guest's config: itself, or the default with numbers changed by path.

    Raises as ``Settings.changed``.
    """
    return given if isinstance(given, kind) else kind().changed(given or {})  # type: ignore[arg-type]


class Guest(OnPath, ABC):
    """A SLAM from outside behind this project's protocol.

    It gets each scan's end points, de-skewed by odometry as "shunting" gets them, and odometry's
    guess of the pose. Guests report no covariance of their own that means anything, so theirs is
    zero: no claim. Raises ``InvalidValueError`` for frames without a scan or out of order, and for
    what is no pose.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next frame is the origin of the map."""
        self._before: Odometry | None = None
        self._T_map_robot: Float = np.zeros(3)
        self._path = PosePath()

    def update(self, frame: Frame) -> Estimate:
        """Guess by odometry, let the guest match."""
        if frame.scan is None:
            raise InvalidValueError(f"{type(self).__name__} needs a laser scan in every frame")
        self._path.check_order(frame.stamp_ns)
        before = frame.odometry if self._before is None else self._before
        prediction = predict(self._T_map_robot, before, frame.odometry)
        if self._before is None:
            self.begin(frame.scan.spec)
        points_robot = from_scan(frame.scan, prediction.twist, _GRAIN).points_robot
        T_map_robot, diagnostics = self.locate(points_robot, prediction)
        estimate = Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=T_map_robot,
            covariance=np.zeros((3, 3)),
            diagnostics=diagnostics,
        )
        self._before, self._T_map_robot = frame.odometry, np.array(estimate.T_map_robot)
        self._path.add(frame.stamp_ns, self._T_map_robot)
        return estimate

    @abstractmethod
    def begin(self, spec: LaserSpec) -> None:
        """Make the guest again, for the scanner of the first frame."""

    @abstractmethod
    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """T_map_robot (3,) of a scan whose end points are (n, 2), and numbers to report."""
