# SPDX-License-Identifier: Apache-2.0
"""What a SLAM is to this project: a protocol of four methods, and the names it can be asked for by.

    class MySlam:
        def reset(self) -> None: ...
        def update(self, frame: Frame) -> Estimate: ...
        def map(self) -> Raster | None: ...
        def trajectory(self) -> Trajectory: ...

A SLAM may have more: ``HasLandmarks``, ``HasChanges``, ``CanSave``, ``SaysCells`` and
``RunsAtTheEnd`` are optional.
Who wants one of these asks whether it is there (``slam.replay.Track``), never for a class.

``create("shunting")`` makes a registered one, ``create("my_package.my_module:MySlam")`` any class,
``create("pipe:./my_slam --option")`` a program in any language (``slam.guests.pipe``),
``create("ros2")`` and ``create("ros2:COMMAND")`` a node of ROS 2 (``slam.ros.slam``).
``create("shunting{matching.reward=7}")`` sets numbers of its config (``slam.variants``).
``create("oracle(shunting)")`` shows it no returns from movers (``slam.oracle``), and
``create("oracle(map)")`` is shown the true map instead (``slam.oracle_map``).
"""

import importlib
import inspect
import os
import sysconfig
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

from slam.errors import InvalidValueError, MobiliaError, SlamFailedError, UnknownNameError, meant
from slam.estimate import Changes, Estimate, Landmarks, Raster
from slam.frames import Float, Frame
from slam.names import first_line, join_folders, refuse_code
from slam.settings import Settings
from slam.trajectory import Trajectory
from slam.variants import MAP_ORACLE, inside, oracle_of, parsed

__all__ = [
    "CanSave", "Changes", "Estimate", "HasChanges", "HasLandmarks", "Landmarks", "Raster",
    "RunsAtTheEnd", "SaysCells", "SlamSystem", "config_of", "create", "describe", "names",
    "refuse_at_the_end", "register", "register_prefix", "told",
]  # fmt: skip


_FOLDERS = (*map(sysconfig.get_path, ("stdlib", "purelib", "platlib")), str(Path(__file__).parent))
_LIBRARIES = ("<frozen ", *(folder + os.sep for folder in _FOLDERS))


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


@runtime_checkable
class HasLandmarks(Protocol):
    """Optional: a map of points. The film draws its ellipses, the paper's figures count them."""

    def landmarks(self) -> Landmarks:
        """The landmarks now."""


@runtime_checkable
class HasChanges(Protocol):
    """Optional: a map that knows what moved. A run draws it as ``changes.png``."""

    def changes(self) -> Changes | None:
        """What appeared and what is gone lately, None where nothing can be said."""


@runtime_checkable
class CanSave(Protocol):
    """Optional: a map that can be kept. A run writes it as ``map.npz``."""

    def save(self, path: Path) -> None:
        """Write the map; raises ``OutputError``."""


@runtime_checkable
class MovingMap(Protocol):
    """Optional: a map that closed loops move. ``diagnostics["correction"]`` is not zero then."""

    def poses_in_map(self) -> Float:
        """(n, 3) of all frames so far in the map as it is now."""


@runtime_checkable
class SaysCells(Protocol):
    """Optional: what the cells of ``map()`` hold, for titles: "probabilities", "activities"."""

    cells_hold: str


@runtime_checkable
class RunsAtTheEnd(Protocol):
    """Optional: a program over files. ``update`` reports odometry's pose until the last frame."""

    def estimates_at_end(self) -> Sequence[tuple[Estimate, float]]:
        """Of each frame so far, in order: the estimate, and the processor time it took, s.

        Each estimate must be of its frame and those before it: it is scored as an online one.
        """


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
    base = parsed(inside(name))[0]
    own = base in OWN or f"{base}:" in OWN_PREFIXES or name == MAP_ORACLE
    if ":" in base or own or base in _registry:
        return
    raise UnknownNameError(
        f"no SLAM is called '{base}'.{meant(base, names())} Known: {', '.join(names())}, "
        "or module:Class, or pipe:COMMAND, or ros2[:COMMAND], or oracle(SLAM)."
    )


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
        by_map: SlamSystem = importlib.import_module("slam.oracle_map").MapOracle()
        return by_map
    if (wanted := oracle_of(name)) is not None:
        oracle: SlamSystem = importlib.import_module("slam.oracle").Oracle(
            create(wanted[0], **config), wanted[1]
        )
        return oracle
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
    if prefix in OWN_PREFIXES:  # a module that registers itself
        importlib.import_module(OWN_PREFIXES[prefix].partition(":")[0])
    if prefix in _prefixes:
        return partial(_prefixes[prefix], rest)
    if colon:
        return _load(name)
    check_name(name)
    registered = _registered(name)
    assert registered is not None
    return registered


def refuse_at_the_end(system: object, name: str, what: str) -> None:
    """``InvalidValueError`` for a SLAM that runs at the end, where ``what`` needs poses before."""
    if isinstance(system, RunsAtTheEnd):
        raise InvalidValueError(
            f"SLAM '{name}' is a program over files: it has no pose before the last scan, "
            f"and {what} needs one at every scan"
        )


def told(error: BaseException) -> str:
    """An exception of somebody else's code in one line: type, words, and their last line in it.

    That is the last line outside Python's library, installed packages and this one, if there is
    any: where their code called NumPy, not the line of NumPy that raised.
    """
    words = str(error).strip().partition("\n")[0]
    what = f"{type(error).__name__}: {words}" if words else type(error).__name__
    trace = traceback.extract_tb(error.__traceback__)
    theirs = [at for at in trace if not at.filename.startswith(_LIBRARIES)] or trace
    where = f" ({Path(theirs[-1].filename).name}:{theirs[-1].lineno})" if theirs else ""
    return what + where


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
