# SPDX-License-Identifier: Apache-2.0
"""What a SLAM is to this project: a protocol of five methods, and the names it can be asked for by.

    class MySlam:
        def reset(self) -> None: ...
        def update(self, frame: Frame) -> Estimate: ...
        def map(self) -> Raster | None: ...
        def trajectory(self) -> Trajectory: ...

``create("shunting")`` makes a registered one, ``create("my_package.my_module:MySlam")`` any class,
``create("pipe:./my_slam --option")`` a program in any language (``slam.guests.pipe``).
``create("shunting{matching.reward=7}")`` sets numbers of its config (``slam.variants``).
"""

from __future__ import annotations

import difflib
import importlib
import inspect
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from slam.checked import covariance, frozen, pose
from slam.errors import InvalidValueError, MobiliaError, SlamFailedError, UnknownNameError
from slam.frames import Float, Frame
from slam.names import first_line, join_folders, refuse_code
from slam.settings import Settings
from slam.trajectory import Trajectory
from slam.variants import parsed


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Where a SLAM believes the robot is.

    stamp_ns     the frame's stamp
    T_map_robot  (3,) m, m, rad; the map frame is the robot's frame at the first update
    covariance   (3, 3) of (x, y, theta) in the map frame
    converged    False when the system does not trust this estimate; never a plausible stand-in
    diagnostics  JSON-serialisable numbers and words, e.g. {"state": "tracking", "matched": 0.97}.
                 "unobservable": number of directions of position (0, 1 or 2) about which the sensor
                 says nothing now, as along a bare corridor; "unobservable_rad": the one direction,
                 in the map frame. ``converged`` stays True then: nothing is wrong, the estimate is
                 odometry's there, and the covariance grows along it
    """

    stamp_ns: int
    T_map_robot: Float
    covariance: Float
    converged: bool = True
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_map_robot", pose("Estimate", "T_map_robot", self.T_map_robot))
        object.__setattr__(
            self, "covariance", covariance("Estimate", "covariance", self.covariance)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Raster:
    """A map as an image of existence.

    values        (height, width) float32 in [0, 1], NaN unknown; row 0 is the lowest y
    resolution_m  edge of a cell, m
    T_map_origin  (3,) pose of the outer corner of values[0, 0] in the map frame
    """

    values: NDArray[np.float32]
    resolution_m: float
    T_map_origin: Float

    def __post_init__(self) -> None:
        values = frozen("Raster", "values", self.values, (None, None), np.float32)
        known = values[~np.isnan(values)]
        if known.size and (known.min() < 0.0 or known.max() > 1.0):
            raise InvalidValueError(
                f"Raster.values must lie in [0, 1] or be NaN, got {known.min()}..{known.max()}"
            )
        if not 0.0 < self.resolution_m < np.inf:
            raise InvalidValueError(f"Raster.resolution_m must be > 0 m, got {self.resolution_m}")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "T_map_origin", pose("Raster", "T_map_origin", self.T_map_origin))


@runtime_checkable
class SlamSystem(Protocol):
    """One SLAM. ``update`` gets frames in the order of their stamps, the first at the origin."""

    def reset(self) -> None:
        """Forget everything; the next frame is the first."""

    def update(self, frame: Frame) -> Estimate:
        """Take a frame in, say where the robot is. Must not read ``frame.truth`` or ``labels``."""

    def map(self) -> Raster | None:
        """The map now, or None for a system without one."""

    def trajectory(self) -> Trajectory:
        """Final poses of all frames so far; the online ones where nothing better exists."""


Factory = Callable[..., object]
F = TypeVar("F", bound=Callable[..., Any])
_registry: dict[str, Factory] = {}
OWN = {
    "ekf": "slam.ekf.slam:EkfSlam",
    "karto": "slam.guests.karto:KartoSlam",
    "kiss-icp": "slam.guests.kiss:KissIcpSlam",
    "occupancy": "slam.grid.occupancy:OccupancySlam",
    "odometry": "slam.odometry:OdometrySlam",
    "shunting": "slam.shunting.slam:ShuntingSlam",
    "shunting-features": "slam.shunting.featured:FeaturedShuntingSlam",
}
"""This project's SLAMs by name, as ``module:Class``: imported when one is asked for."""


def register(name: str) -> Callable[[F], F]:
    """Class or factory decorator: make it available as ``create(name)``."""

    def add(factory: F) -> F:
        _registry[name] = factory
        return factory

    return add


def names() -> list[str]:
    """Registered names, sorted."""
    return sorted({*OWN, *_registry})


def _registered(name: str) -> Factory | None:
    """The factory of that name; None where nothing is registered under it."""
    if name not in _registry and name in OWN:
        module, _, attribute = OWN[name].partition(":")
        own: Factory = getattr(importlib.import_module(module), attribute)
        return own
    return _registry.get(name)


def describe(name: str) -> str:
    """The first line of the docstring of a registered system.

    That of a system which is not imported yet is read from its file.
    """
    if name in OWN and name not in _registry:
        return first_line(OWN[name])
    return (inspect.getdoc(_registry[name]) or "").partition("\n")[0]


def check_name(name: str) -> None:
    """Raise what ``create`` raises for a name that nothing is registered under; import nothing."""
    base = parsed(name)[0]
    if ":" in base or base in OWN or base in _registry:
        return
    near = difflib.get_close_matches(base, names(), n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    raise UnknownNameError(
        f"no SLAM is called '{base}'.{hint} Known: {', '.join(names())}, or module:Class, "
        "or pipe:COMMAND."
    )


def config_of(name: str) -> tuple[Settings, Settings] | None:
    """The config of a registered SLAM, or of a variant of one, and its default.

    None for one that has none, or is not ours. Raises as ``create`` does for its numbers.
    """
    base, changes = parsed(name)
    kind = getattr(_registered(base), "config_class", None)
    if kind is None:
        return None
    default: Settings = kind()
    return default.changed(changes), default


def create(name: str, **config: Any) -> SlamSystem:
    """A fresh SLAM by registered name, as ``module:Class`` or as ``pipe:COMMAND``.

    ``config`` goes to its constructor.

    Raises ``UnknownNameError`` with the nearest known name, or what is wrong with the entry,
    ``InvalidValueError`` for options that its constructor does not have, and
    ``UntrustedNameError`` for a name of code that was read from a file (``slam.names``).
    """
    refuse_code(name, "SLAM")
    name, changes = parsed(name)
    if changes:
        if "config" in config:
            raise InvalidValueError(f"SLAM '{name}': numbers in its name and a config, not both")
        if ":" not in name and (own := _registered(name)) and not hasattr(own, "config_class"):
            raise InvalidValueError(f"SLAM '{name}' has no numbers to set")
        config["config"] = changes
    if name.startswith("pipe:"):
        from slam.guests.pipe import PipeSlam  # it imports this module

        factory: Factory = partial(PipeSlam, name.removeprefix("pipe:"))
    elif ":" in name:
        factory = _load(name)
    else:
        check_name(name)
        registered = _registered(name)
        assert registered is not None
        factory = registered
    _check_options(name, factory, config)
    try:
        system = factory(**config)
    except SlamFailedError as error:
        raise error.at(f"SLAM '{name}' cannot be made:") from error
    except MobiliaError:
        raise
    except Exception as error:
        raise SlamFailedError(f"SLAM '{name}' cannot be made: {told(error)}") from error
    if not isinstance(system, SlamSystem):
        missing = [m for m in ("reset", "update", "map", "trajectory") if not hasattr(system, m)]
        raise UnknownNameError(f"'{name}' is no SlamSystem: it has no {', '.join(missing)}()")
    return system


def told(error: BaseException) -> str:
    """An exception of somebody else's code in one line: type, words, and where it was raised."""
    words = str(error).strip().partition("\n")[0]
    what = f"{type(error).__name__}: {words}" if words else type(error).__name__
    trace = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(trace[-1].filename).name}:{trace[-1].lineno})" if trace else ""
    return what + where


def _check_options(name: str, factory: Factory, config: Mapping[str, Any]) -> None:
    if not callable(factory):
        raise UnknownNameError(f"'{name}' is no class or function")
    try:
        signature = inspect.signature(factory)
    except ValueError:  # some built-in callables do not tell
        return
    try:
        signature.bind(**config)
    except TypeError as error:
        raise InvalidValueError(f"SLAM '{name}': {error}") from error


def _load(entry: str) -> Factory:
    module_name, _, attribute = entry.partition(":")
    join_folders()
    try:
        module = importlib.import_module(module_name)
    except (ImportError, TypeError, ValueError) as error:  # the last two: no proper module name
        raise UnknownNameError(f"'{entry}': cannot import '{module_name}' ({error})") from error
    except Exception as error:
        raise SlamFailedError(f"'{entry}': '{module_name}' fails: {told(error)}") from error
    try:
        factory: Factory = getattr(module, attribute)
    except AttributeError:
        raise UnknownNameError(f"'{entry}': module '{module_name}' has no '{attribute}'") from None
    return factory
