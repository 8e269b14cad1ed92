# SPDX-License-Identifier: Apache-2.0
"""What an environment takes, checked by name: arguments, the options of a reset, actions."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, defstruct
from numpy.typing import NDArray

from scenes.crowd import crowd_of
from scenes.registry import check_name
from scenes.scene import HIGHEST, LOWEST
from sim.core.dynamism import Dynamism
from sim.gym.goals import Goal, goal_of
from sim.sensors.lidar.registry import scanner_of
from sim.sensors.odometry.config import preset
from slam.errors import InvalidValueError
from slam.shaped import Pose, instance, shaped, within

OPTIONS = (
    "goal", "start", "seeds", "scene", "n_chairs", "n_people", "dynamism", "motion", "change",
    "crowd", "rates", "scan_height_m", "laser",
)  # fmt: skip
_BY_NAME = dict.fromkeys(("seeds", "scene", "rates"), dict[str, Any] | None)
_Options = defstruct(  # the values of the others are checked where they are used
    "Options",
    [(name, _BY_NAME.get(name, Any), None) for name in OPTIONS],
    forbid_unknown_fields=True,
)


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
    shaped("labels", settings["labels"], bool)
    return {
        **settings,
        "crowd": crowd if crowd is None else str(crowd_of(crowd)),
        "laser": scanner_of(settings["laser"]),
    }


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One episode: arguments of ``Simulation`` but the seed, overrides of streams, the goal.

    ``goal``: (x, y) m, "random" or None.
    """

    settings: dict[str, Any]
    seeds: dict[str, int]
    goal: Goal | str | None


def episode(
    settings: Mapping[str, Any],
    options: Mapping[str, Any] | None,
    goal: Goal | str | None = None,
) -> Episode:
    """``settings`` and ``goal`` of the environment with the ``options`` of one reset put in.

    Raises ``InvalidValueError`` naming the option that is unknown or has a value it cannot have.
    """
    own = shaped("reset options", {} if options is None else options, _Options)
    given = {name: value for name in OPTIONS if (value := getattr(own, name)) is not None}
    merged = dict(settings)
    merged |= _scene_options(given, settings)
    passed_on = ("n_chairs", "n_people", "scan_height_m", "crowd")
    merged |= {name: given[name] for name in passed_on if name in given}
    merged["dynamism"] = _rates(merged, given)
    merged |= {"motion": None, "change": None}
    if merged.get("crowd") is None:
        merged.pop("crowd", None)
    else:
        merged["crowd"] = str(crowd_of(merged["crowd"]))
    merged["laser"] = scanner_of(given.get("laser", merged["laser"]))
    if "start" in given:
        merged["start"] = shaped("option start", given["start"], Pose)
    return Episode(
        settings=merged,
        seeds=given.get("seeds", {}),
        goal=goal_of("option goal", given.get("goal", goal)),
    )


def checked_seed(seed: Any) -> int | None:
    """None or a whole number >= 0, of NumPy's or Python's; else ``InvalidValueError``."""
    number: int | None = shaped("seed", seed, Annotated[int, Meta(ge=0)] | None)
    return number


def _scene_options(given: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the scene's recipe; the simulation's own settings are not among them."""
    options: dict[str, Any] = given.get("scene", {})
    for name in sorted(set(options) & {"seed", "drive", *settings}):
        raise InvalidValueError(
            f"option scene takes options of the scene's recipe, and {name!r} is none of them"
        )
    return options


def _rates(settings: Mapping[str, Any], given: Mapping[str, Any]) -> Dynamism:
    """Of the environment; a dynamism of the episode replaces all that the environment has said."""
    said = settings if "dynamism" not in given else {}
    axes = {name: given.get(name, said.get(name)) for name in ("motion", "change")}
    dynamism = given.get("dynamism", settings["dynamism"])
    rates = Dynamism.of(dynamism, **axes)
    changes = given.get("rates", {})
    known = {f.name for f in fields(Dynamism)}
    for name in sorted(set(changes) - known):
        raise InvalidValueError(
            f"option rates: unknown rate {name!r}; known: {', '.join(sorted(known))}"
        )
    return replace(rates, **changes)


def clipped(action: Any) -> tuple[float, float]:
    """Forward speed and turn rate, each in [-1, 1]: finite numbers beyond are clipped.

    Raises ``InvalidValueError`` for what is not two numbers (words, objects and switches are none),
    and for NaN and infinities alike.
    """
    v, omega = map(float, _numbers(action, (2,), "an action is two").tolist())
    return min(max(v, -1.0), 1.0), min(max(omega, -1.0), 1.0)


def of_rooms(actions: Any, n: int) -> NDArray[Any]:
    """(n, 2) finite numbers, one action for each of ``n`` rooms; else ``InvalidValueError``."""
    return _numbers(actions, (n, 2), f"actions are ({n}, 2)")


def _numbers(value: Any, shape: tuple[int, ...], words: str) -> NDArray[Any]:
    array = array_of(value)
    if array.shape != shape or array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise InvalidValueError(f"{words} finite numbers in [-1, 1], got {value!r:.200}")
    return array


def array_of(value: Any) -> NDArray[Any]:
    """``np.asarray``; an empty array for what none can hold."""
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # ragged, for instance
        return np.zeros(0)
