# SPDX-License-Identifier: Apache-2.0
"""The robot that a scene is made for."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from scenes.from_map.floor import ROBOT_M
from sim.world import robots
from slam.errors import InvalidValueError

LIKE = "pioneer3dx"


def robot_of(words: str | None) -> tuple[float, str]:
    """m of its radius about its axle, and the TOML that names it in a scene's file.

    words  a robot's name or file, or the radius of one like ``LIKE``; None: the scenes' own, of
           which a file says nothing
    Raises as ``sim.world.robots.read_robot`` and ``robot_of``.
    """
    if words is None:
        return ROBOT_M, ""
    if words in robots.names():
        tables, lines = robots.read_robot(words), [f'robot = "{words}"']
    else:
        tables = _of_radius(words) or robots.read_robot(words)
        lines = list(_toml(tables, "robot"))
    robot = robots.robot_of(tables)
    return robot.radius + abs(robot.ahead_m), "\n".join(["", *lines])


def _of_radius(words: str) -> dict[str, Any] | None:
    """The tables of ``LIKE`` with that radius in m, the rest in proportion."""
    try:
        radius_m = float(words)
    except ValueError:
        return None
    tables = robots.read_robot(LIKE)
    times = radius_m / tables["footprint"]["radius_m"]
    if not 0.05 <= radius_m <= 1.0:
        raise InvalidValueError(f"a robot's radius_m must be a number from 0.05 to 1, got {words}")
    tables |= {"name": f"{LIKE} of {radius_m:g} m", "mass_kg": tables["mass_kg"] * times**2}
    tables.pop("inertia_kgm2", None)
    tables["footprint"] = {"shape": "circle", "radius_m": radius_m}
    tables["drive"] |= {"track_m": tables["drive"]["track_m"] * times}
    tables["scanner"] |= {"x_m": tables["scanner"]["x_m"] * times}
    return tables


def _toml(tables: Mapping[str, Any], name: str) -> Iterator[str]:
    yield f"[{name}]"
    yield from (f"{k} = {json.dumps(v)}" for k, v in tables.items() if not isinstance(v, dict))
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from _toml(value, f"{name}.{key}")
