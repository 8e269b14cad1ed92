# SPDX-License-Identifier: Apache-2.0
"""SLAM on a stream of frames. Works without a simulator: never imports mujoco, gymnasium or sim.

The public names are imported when they are first asked for, and each SLAM when it is created
(``slam.system``): ``import slam`` alone loads no compiler.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import slam.names  # noqa: F401  (a module called like the function below, which comes after it)

if TYPE_CHECKING:
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
    from slam.scan_points import deskewed, points_robot
    from slam.system import Estimate, Raster, SlamSystem, config_of, create, register
    from slam.trajectory import Trajectory

if Path(".numba_config.yaml").exists():  # not to be read, whoever imports Numba next
    from slam import _numba  # noqa: F401

_FRAMES = (
    "BeamClass", "BeamLabels", "Features", "Frame", "LaserSpec", "Odometry", "Scan", "Stream",
    "StreamMetadata",
)  # fmt: skip
_POINTS = ("deskewed", "points_robot")
_SYSTEM = ("Estimate", "Raster", "SlamSystem", "config_of", "create", "register")
_WHERE = {
    **dict.fromkeys(_FRAMES, "slam.frames"),
    **dict.fromkeys(_SYSTEM, "slam.system"),
    **dict.fromkeys(_POINTS, "slam.scan_points"),
    "Trajectory": "slam.trajectory",
}

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
    "deskewed",
    "names",
    "points_robot",
    "register",
]


def names() -> list[str]:
    """Names that ``create`` knows, sorted."""
    from slam import system

    return system.names()


def __getattr__(name: str) -> Any:
    """A public name, from the module that has it."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_WHERE[name]), name)
    return value


def __dir__() -> list[str]:
    """What there is, loaded or not."""
    return sorted({*globals(), *__all__})
