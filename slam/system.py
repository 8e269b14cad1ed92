# SPDX-License-Identifier: Apache-2.0
"""The names that a SLAM (``slam.interface``) can be asked for by.

``create("shunting")`` makes a registered one, ``create("my_package.my_module:MySlam")`` any class,
``create("pipe:./my_slam --option")`` a program in any language (``slam.guests.pipe``),
``create("ros2")`` and ``create("ros2:COMMAND")`` a node of ROS 2 (``slam.ros.slam``).
``create("shunting{matching.reward=7}")`` sets numbers of its config (``slam.variants``).
``create("oracle(shunting)")`` shows it no returns from movers (``slam.oracle``), and
``create("oracle(map)")`` is shown the true map instead (``slam.oracle_map``).
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, TypeVar

from slam.errors import InvalidValueError, MobiliaError, SlamFailedError, UnknownNameError, meant
from slam.estimate import Changes, Estimate, Landmarks, Raster
from slam.interface import (
    CanSave,
    HasChanges,
    HasLandmarks,
    MovingMap,
    RunsAtTheEnd,
    SaysCells,
    SlamSystem,
    refuse_at_the_end,
    told,
)
from slam.names import code_meant, first_line, join_folders, refuse_code
from slam.oracle import Oracle
from slam.settings import Settings
from slam.variants import MAP_ORACLE, inside, oracle_of, parsed

__all__ = [
    "CanSave", "Changes", "Estimate", "HasChanges", "HasLandmarks", "Landmarks", "MovingMap",
    "Raster", "RunsAtTheEnd", "SaysCells", "SlamSystem", "config_of", "create", "describe", "names",
    "refuse_at_the_end", "register", "register_prefix", "told",
]  # fmt: skip


Factory = Callable[..., object]
F = TypeVar("F", bound=Callable[..., Any])
_registry: dict[str, Factory] = {}
OWN = {
    "ekf": "slam.ekf.slam:EkfSlam",
    "genz-icp": "slam.guests.genz:GenzIcpSlam",
    "icp-slam": "slam.guests.mrpt:IcpSlam",
    "karto": "slam.guests.karto:KartoSlam",
    "kiss-icp": "slam.guests.kiss:KissIcpSlam",
    "occupancy": "slam.grid.occupancy:OccupancySlam",
    "odometry": "slam.odometry:OdometrySlam",
    "rbpf-slam": "slam.guests.mrpt:RbpfSlam",
    "shunting": "slam.shunting.slam:ShuntingSlam",
    "shunting-features": "slam.shunting.featured:FeaturedShuntingSlam",
    "small-gicp": "slam.guests.gicp:SmallGicpSlam",
    "yag-slam": "slam.guests.yag:YagSlam",
}
"""This project's SLAMs by name, as ``module:Class``: imported when one is asked for."""
OWN_PREFIXES = {
    "pipe:": "slam.guests.pipe:PipeSlam",
    "ros2:": "slam.ros.slam:Ros2Slam",
    "ros2-zenoh:": "slam.ros.slam:Ros2ZenohSlam",
}
"""This project's prefixes of names, the same way; a prefix without ":" has nothing behind it."""
_prefixes: dict[str, Callable[..., object]] = {}


def register(name: str) -> Callable[[F], F]:
    """Class or factory decorator: make it available as ``create(name)``."""

    def add(factory: F) -> F:
        _registry[name] = factory
        return factory

    return add


def register_prefix(prefix: str) -> Callable[[F], F]:
    """Class or factory decorator: ``create(prefix + rest)`` calls it with ``rest`` and the options.

    Raises ``InvalidValueError`` unless ``prefix`` ends in a colon: what a name of it runs is not
    registered, so such a name out of a file must count as code (``slam.names.is_code``).
    """
    if not prefix.endswith(":"):
        raise InvalidValueError(f"a prefix of SLAM names must end in ':', got {prefix!r}")

    def add(factory: F) -> F:
        _prefixes[prefix] = factory
        return factory

    return add


def names() -> list[str]:
    """Registered names, sorted."""
    return sorted({*OWN, *_registry})


def _registered(name: str) -> Factory | None:
    """The factory of that name; None where nothing is registered under it."""
    if name not in _registry and name in OWN:
        return _own(OWN[name])
    return _registry.get(name)


def _own(entry: str) -> Factory:
    module, _, attribute = entry.partition(":")
    own: Factory = getattr(import_module(module), attribute)
    return own


def describe(name: str) -> str:
    """The first line of the docstring of a registered system.

    That of a system which is not imported yet is read from its file.
    """
    if name in OWN and name not in _registry:
        return first_line(OWN[name])
    return (inspect.getdoc(_registry[name]) or "").partition("\n")[0]


def check_name(name: str) -> None:
    """Raise what ``create`` raises for a name that nothing is registered under; import nothing."""
    base = parsed(inside(name))[0]
    own = base in OWN or f"{base}:" in OWN_PREFIXES or name == MAP_ORACLE
    if ":" in base or own or base in _registry:
        return
    raise UnknownNameError(
        f"no SLAM is called '{base}'.{_meant(base, names())} Known: {', '.join(names())}, "
        "or module:Class, or pipe:COMMAND, or ros2[:COMMAND], or oracle(SLAM)."
    )


MOST_MEANT = 3  # classes that a hint names


def _meant(name: str, known: Sequence[str]) -> str:
    """A hint of classes in a file here of that name, else of the nearest of those known."""
    here = [f"'{code}'" for code in code_meant(name)[:MOST_MEANT]]
    return f" Did you mean {' or '.join(here)}?" if here else meant(name, known)


def config_of(name: str) -> tuple[Settings, Settings] | None:
    """The config of a registered SLAM, or of a variant of one, and its default.

    None for one that has none, or is not ours. Raises as ``create`` does for its numbers.
    """
    base, changes = parsed(inside(name))
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
    if name == MAP_ORACLE:
        from slam.oracle_map import MapOracle  # it loads a compiler

        return MapOracle()
    if (wanted := oracle_of(name)) is not None:
        return Oracle(create(wanted[0], **config), wanted[1])
    name, changes = parsed(name)
    if changes:
        if "config" in config:
            raise InvalidValueError(f"SLAM '{name}': numbers in its name and a config, not both")
        if ":" not in name and (own := _registered(name)) and not hasattr(own, "config_class"):
            raise InvalidValueError(f"SLAM '{name}' has no numbers to set")
        config["config"] = changes
    factory = _factory(name)
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


def _factory(name: str) -> Factory:
    """What makes the SLAM of that name: behind a prefix, in a module, or registered."""
    start, colon, rest = name.partition(":")
    prefix = f"{start}:"
    if prefix in _prefixes:
        return partial(_prefixes[prefix], rest)
    if prefix in OWN_PREFIXES:
        return partial(_own(OWN_PREFIXES[prefix]), rest)
    if colon:
        return _load(name)
    check_name(name)
    registered = _registered(name)
    assert registered is not None
    return registered


def _check_options(name: str, factory: Factory, config: Mapping[str, Any]) -> None:
    if not callable(factory):
        raise UnknownNameError(f"'{name}' is no class or function")
    try:
        signature = inspect.signature(factory)
    except ValueError:  # some built-in callables have none
        return
    try:
        signature.bind(**config)
    except TypeError as error:
        raise InvalidValueError(f"SLAM '{name}': {error}") from error


def _load(entry: str) -> Factory:
    module_name, _, attribute = entry.partition(":")
    join_folders()
    try:
        module = import_module(module_name)
    except (ImportError, TypeError, ValueError) as error:  # the last two: no proper module name
        raise UnknownNameError(
            f"'{entry}': cannot import '{module_name}' ({error}).{_meant(entry, [])}"
        ) from error
    except Exception as error:
        raise SlamFailedError(f"'{entry}': '{module_name}' fails: {told(error)}") from error
    try:
        factory: Factory = getattr(module, attribute)
    except AttributeError:
        raise UnknownNameError(
            f"'{entry}': module '{module_name}' has no '{attribute}'.{_meant(entry, [])}"
        ) from None
    return factory
