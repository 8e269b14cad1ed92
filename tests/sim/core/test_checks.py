# SPDX-License-Identifier: Apache-2.0
"""Values of the wrong type are refused by name, wherever a user sets one."""

import math
from typing import Any

import pytest

from sim.actors.robot import DriveConfig
from sim.core.dynamism import Dynamism
from sim.recording.recipe import Recipe
from sim.sensors.lidar.models.lms221 import Lms221Config, RangeEffects
from sim.sensors.odometry.config import OdometryConfig
from sim.simulation import Simulation
from slam.errors import InvalidValueError


@pytest.mark.parametrize(
    ("config", "field", "value"),
    [
        (Lms221Config, "noise_std_m", "much"),
        (Lms221Config, "range_mode", ["8m"]),
        (Lms221Config, "effects", {"glass": False}),
        (Lms221Config, "fov_deg", 180.5),
        (RangeEffects, "dropout_rate", 1.5),
        (Dynamism, "moving_share", True),
        (OdometryConfig, "scale_std", "0.1"),
        (DriveConfig, "accel", None),
    ],
)
def test_a_field_of_the_wrong_type_is_named(config, field, value):
    with pytest.raises(InvalidValueError, match=rf"\.{field} must be"):
        config(**{field: value})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"laser": {"fov_deg": 100}}, "laser must be a scanner's name"),
        ({"drive": {"accel": 2.0}}, "drive must be a DriveConfig"),
        ({"odometry": 3}, "odometry must be a OdometryConfig"),
        ({"start": (0.0, 0.0)}, "start must be"),
        ({"start": "here"}, "start must be"),
        ({"scene": None}, "scene must be a Scene"),
    ],
)
def test_a_simulation_names_what_it_cannot_take(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        Simulation(**{"scene": "arena", **settings})


@pytest.mark.parametrize("seconds", [math.nan, math.inf, True, "9", 10**400, 0.0])
def test_seconds_of_a_recipe_are_a_number_that_can_be(seconds: Any) -> None:
    with pytest.raises(InvalidValueError, match=r"Recipe\.seconds must be"):
        Recipe(scene="arena", seed=0, dynamism=0.5, seconds=seconds)
