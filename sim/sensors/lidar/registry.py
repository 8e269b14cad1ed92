# SPDX-License-Identifier: Apache-2.0
"""Scanner models by name: ``scanner_of("utm30lx:noise")``.

A model is a function that returns a ``Scanner``, registered under a name; those of this project are
the files of ``sim.sensors.lidar.models``. Its keyword arguments are the model's settings, numbers
or words. A name in writing is ``MODEL``, ``MODEL:ERRORS`` or ``MODEL(SETTING=VALUE, ...):ERRORS``;
errors alone (``noise``) are those of the LMS-221. Writing never names code: what is not registered
is refused.
"""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from sim.sensors.lidar.scanner import ERRORS, Scanner
from slam.errors import InvalidValueError, UnknownNameError, meant
from slam.frames import Float, LaserSpec

DEFAULT = "lms221"
MAX_TEXT = 200  # characters of a name in writing
_WRITTEN = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:\(([^()]*)\))?(?::([a-z]+))?")


@runtime_checkable
class ScannerConfig(Protocol):
    """How a scanner is set: a ``Scanner``, or a dataclass that gives one."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def scanner(self) -> Scanner:
        """The model that is set so."""

    def only(self, errors: str) -> "ScannerConfig":
        """With those errors alone: "full", "noise" or "ideal"."""

    def spec(self, T_robot_laser: Float | None = None) -> LaserSpec:
        """Geometry and beam times."""


F = TypeVar("F", bound=Callable[..., ScannerConfig])
_models: dict[str, Callable[..., ScannerConfig]] = {}


def register(name: str) -> Callable[[F], F]:
    """Function decorator: make a model available under a name."""

    def add(model: F) -> F:
        _models[name] = model
        return model

    return add


@cache
def _load_own() -> None:
    """Import this project's models; not when this module is, as they register themselves here."""
    from sim.sensors.lidar import models

    for found in pkgutil.iter_modules(models.__path__):
        importlib.import_module(f"{models.__name__}.{found.name}")


def names() -> list[str]:
    """Registered names, the default first."""
    _load_own()
    return [DEFAULT, *sorted(set(_models) - {DEFAULT})]


def describe(name: str) -> str:
    """The first line of the docstring of a registered model."""
    return (inspect.getdoc(model_of(name)) or "").partition("\n")[0]


def scanner_of(laser: str | ScannerConfig | None, **settings: Any) -> ScannerConfig:
    """The config of a scanner: None is the default, a word is a name in writing.

    settings  of the model, for a name

    Raises ``UnknownNameError`` for a name that is not registered, with what there is, and
    ``InvalidValueError`` for anything else that is no scanner.
    """
    if laser is None or isinstance(laser, str):
        return _named("full" if laser is None else laser, settings)
    if not isinstance(laser, ScannerConfig):
        raise InvalidValueError(
            f"laser must be a scanner's name, a Scanner or a Lms221Config, got {laser!r:.80}"
        )
    if settings:
        raise InvalidValueError(f"{', '.join(settings)} cannot be set on a scanner made already")
    return laser


def written(text: str, **settings: Any) -> str:
    """A name in writing with these settings besides; raises as ``scanner_of``."""
    scanner_of(text, **settings)
    if not settings:
        return text
    name, inside, errors = _parts(text)
    all_of_it = {**_settings(name, inside or ""), **settings}
    words = ", ".join(f"{key}={value}" for key, value in all_of_it.items())
    return f"{name}({words})" + (f":{errors}" if errors else "")


def _parts(text: str) -> tuple[str, str | None, str | None]:
    """Model, settings and errors of a name in writing; ``UnknownNameError`` for what is none."""
    parts = _WRITTEN.fullmatch(text.strip()) if len(text) <= MAX_TEXT else None
    if parts is None:
        raise UnknownNameError(f"no scanner is called {text!r:.80}. {_known()}")
    name, inside, errors = parts.groups()
    if name in ERRORS and inside is None and errors is None:
        return DEFAULT, None, name
    return name, inside, errors


def _named(text: str, settings: Mapping[str, Any]) -> ScannerConfig:
    name, inside, errors = _parts(text)
    model = model_of(name)
    config = _set(name, model, {**_settings(name, inside or ""), **settings})
    if errors is not None and errors not in ERRORS:
        raise UnknownNameError(
            f"scanner {text!r}: errors must be {', '.join(ERRORS)}, got {errors!r}"
        )
    return config if errors is None else config.only(errors)


def model_of(name: str) -> Callable[..., ScannerConfig]:
    """The registered function; ``UnknownNameError`` with what there is."""
    _load_own()
    if name in _models:
        return _models[name]
    hint = meant(name, [*_models, *ERRORS])
    raise UnknownNameError(f"no scanner is called '{name}'.{hint} {_known()}")


def _known() -> str:
    return (
        f"Known: {', '.join(names())}; each also with :{', :'.join(ERRORS)}; or these alone, "
        f"for {DEFAULT}."
    )


def _settings(name: str, inside: str) -> dict[str, float | str]:
    """``fov_deg=270, beams=541`` as a dictionary; whole numbers stay whole."""
    out: dict[str, float | str] = {}
    for part in filter(None, (word.strip() for word in inside.split(","))):
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not key or not value or key in out:
            raise InvalidValueError(f"scanner {name}: settings are NAME=VALUE, got {part!r}")
        try:
            number = float(value)
            out[key] = int(number) if number.is_integer() and value.isdecimal() else number
        except ValueError:
            out[key] = value
    return out


def _set(
    name: str, model: Callable[..., ScannerConfig], settings: Mapping[str, Any]
) -> ScannerConfig:
    known = [p for p in inspect.signature(model).parameters.values() if p.kind == p.KEYWORD_ONLY]
    for key in settings:
        if key not in {p.name for p in known}:
            words = ", ".join(p.name for p in known) or "none"
            raise InvalidValueError(f"scanner {name} has no setting {key!r}; it has {words}")
    missing = [p.name for p in known if p.default is p.empty and p.name not in settings]
    if missing:
        raise InvalidValueError(f"scanner {name} needs {', '.join(f'{m}=...' for m in missing)}")
    config = model(**settings)
    if not isinstance(config, ScannerConfig):
        raise InvalidValueError(
            f"scanner {name}: its model returned no Scanner, got {config!r:.80}"
        )
    return config
