# SPDX-License-Identifier: Apache-2.0
"""What all guests share: the stream's bookkeeping, de-skewed points and the odometry guess."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from slam.errors import (
    InvalidValueError,
    MissingDependencyError,
    MobiliaError,
    SlamFailedError,
)
from slam.frames import Float, Frame, LaserSpec, Odometry
from slam.frontend.config import FRONTEND, FrontendConfig
from slam.frontend.observations import from_scan
from slam.frontend.odometry_prior import Prediction, predict
from slam.path import PosePath
from slam.system import Estimate, Raster, told
from slam.trajectory import Trajectory


@dataclass(frozen=True)
class _Grain:
    """Guests get the very points that "shunting" sees with its defaults."""

    cell_m: float = 0.03
    range_m: float = 40.0
    frontend: FrontendConfig = FRONTEND


_GRAIN = _Grain()


def needed(module: str, package: str, extra: str = "guests") -> ModuleType:
    """The guest's module; raises ``MissingDependencyError`` that says how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            f"'{package}' cannot be imported ({error}): pip install 'mobilia[{extra}]'"
        ) from error


class Guest(ABC):
    """A SLAM from outside behind this project's protocol.

    It gets each scan's end points, de-skewed by odometry as "shunting" gets them, and odometry's
    guess of the pose. Guests report no covariance of their own that means anything, so theirs is
    zero: no claim. Raises ``InvalidValueError`` for frames without a scan or out of order, and
    ``SlamFailedError`` for a pose that is not finite.
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
            twist = np.zeros(3) if frame.odometry.twist is None else frame.odometry.twist
        else:
            twist = prediction.twist
        points_robot = from_scan(frame.scan, np.asarray(twist), _GRAIN).points_robot
        try:
            T_map_robot, diagnostics = self.locate(points_robot, prediction)
        except MobiliaError:
            raise
        except Exception as error:  # somebody else's code raises whatever it likes
            raise SlamFailedError(f"{type(self).__name__}: {told(error)}") from error
        if not np.isfinite(T_map_robot).all():
            raise SlamFailedError(f"{type(self).__name__} ended at {T_map_robot.tolist()}", "nan")
        self._before, self._T_map_robot = frame.odometry, T_map_robot
        self._path.add(frame.stamp_ns, T_map_robot)
        return Estimate(
            stamp_ns=frame.stamp_ns,
            T_map_robot=T_map_robot,
            covariance=np.zeros((3, 3)),
            diagnostics=diagnostics,
        )

    @abstractmethod
    def begin(self, spec: LaserSpec) -> None:
        """Make the guest anew, for the scanner of the first frame."""

    @abstractmethod
    def locate(self, points_robot: Float, prediction: Prediction) -> tuple[Float, dict[str, float]]:
        """T_map_robot (3,) of a scan whose end points are (n, 2), and numbers to report."""

    def map(self) -> Raster | None:
        """None: a guest's map is its own affair."""
        return None

    def trajectory(self) -> Trajectory:
        """The online poses."""
        return self._path.trajectory()
