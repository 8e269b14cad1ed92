# SPDX-License-Identifier: Apache-2.0
"""The arguments of the environment that go to the simulation, checked before there is one."""

from __future__ import annotations

from typing import Any

from scenes.crowd import crowd_of
from scenes.mounting import HIGHEST, LOWEST
from scenes.registry import check_name
from scenes.scene import within
from sim.core.checks import instance, switch
from sim.core.dynamism import Dynamism
from sim.sensors.lidar.registry import scanner_of
from sim.sensors.odometry.config import preset


def checked_settings(**settings: Any) -> dict[str, Any]:
    """``settings`` of a ``Simulation`` with the scanner looked up and the crowd in full.

    Raises ``InvalidValueError`` or ``UnknownNameError`` by the name of the argument.
    """
    scene, odometry, crowd = (settings[name] for name in ("scene", "odometry", "crowd"))
    instance("scene", scene, str)
    check_name(scene)
    Dynamism.of(settings["dynamism"], motion=settings["motion"], change=settings["change"])
    instance("odometry", odometry, str)
    preset(odometry)
    within("scan_height_m", settings["scan_height_m"], LOWEST, HIGHEST)
    switch("labels", settings["labels"])
    return {
        **settings,
        "crowd": crowd if crowd is None else str(crowd_of(crowd)),
        "laser": scanner_of(settings["laser"]),
    }
