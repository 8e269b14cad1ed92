# SPDX-License-Identifier: Apache-2.0
"""SLAM on a stream of frames. Works without a simulator: never imports mujoco, gymnasium or sim."""

# isort: off
from slam import _numba  # noqa: F401  (before anything else imports Numba)

# isort: on
from slam import ekf as _ekf  # noqa: F401  (registers itself)
from slam import grid as _grid  # noqa: F401
from slam import guests as _guests  # noqa: F401
from slam import odometry as _odometry  # noqa: F401
from slam import shunting as _shunting  # noqa: F401
from slam.frames import (
    BeamClass,
    BeamLabels,
    Features,
    Frame,
    LaserSpec,
    Odometry,
    Scan,
    Stream,
    StreamMetadata,
)
from slam.system import Estimate, Raster, SlamSystem, config_of, create, names, register
from slam.trajectory import Trajectory

__all__ = [
    "BeamClass",
    "BeamLabels",
    "Estimate",
    "Features",
    "Frame",
    "LaserSpec",
    "Odometry",
    "Raster",
    "Scan",
    "SlamSystem",
    "Stream",
    "StreamMetadata",
    "Trajectory",
    "config_of",
    "create",
    "names",
    "register",
]
