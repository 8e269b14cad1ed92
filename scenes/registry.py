# SPDX-License-Identifier: Apache-2.0
"""Scenes by name: ``build("office", seed=3, n_people=0)``.

Ours are plans of ``scenes/plans`` with a table of ``ours.toml`` each; ``random-rooms`` draws its
plan, in Python.
"""

import importlib
import inspect
import tomllib
from collections.abc import Callable
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from scenes import SCAN_HEIGHT, is_file
from slam.bounded import check_file
from slam.errors import InvalidValueError, UnknownNameError, meant
from slam.names import first_line, join_folders, refuse_code

if TYPE_CHECKING:  # both load MuJoCo, and names are checked before that
    from scenes.scene import Scene

Recipe = Callable[..., "Scene"]
F = TypeVar("F", bound=Recipe)
_recipes: dict[str, Recipe] = {}
WALLS = ("visible", "none")
_USUAL = {"walls": WALLS[0], "glass": False, "doors": "open"}
_OURS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("ours.toml").read_text(encoding="utf-8")
)
_DRAWN = {"random-rooms": "scenes.random_rooms:random_rooms"}
OWN = (*_OURS, *_DRAWN)
"""This project's scenes; those in Python are imported when one is asked for."""


def register(name: str) -> Callable[[F], F]:
    """Function decorator: make ``(seed, **options) -> Scene`` available as ``build(name)``."""

    def add(recipe: F) -> F:
        _recipes[name] = recipe
        return recipe

    return add


def names() -> list[str]:
    """Registered names, sorted."""
    return sorted({*OWN, *_recipes})


def describe(name: str) -> str:
    """The first line of the docstring of a registered recipe.

    That of a scene which is not imported yet is read from its file.
    """
    if name in _DRAWN and name not in _recipes:
        return first_line(_DRAWN[name])
    return (inspect.getdoc(_find(name)) or "").partition("\n")[0]


def build(
    name: str,
    seed: int = 0,
    *,
    scan_height_m: float = SCAN_HEIGHT,
    crowd: str = "none",
    **options: Any,
) -> "Scene":
    """The scene of that name and seed; ``module:function`` names any recipe,
    and the path of a TOML or MJCF file the scene that it describes (``scenes.from_file``).

    scan_height_m  of the robot's scanner above the floor, 0.05 to 1 m
    crowd          who is there besides, like "escorts:6,boards:2" (``scenes.crowd``)
    options        of the recipe

    Raises ``UnknownNameError`` with the nearest known name, ``InvalidValueError`` for an option the
    recipe does not know or a value it cannot have, ``UntrustedNameError`` for a ``module:function``
    that was read from a file (``slam.names``).
    """
    make = find(name)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number >= 0, got {seed!r}")
    try:
        inspect.signature(make).bind(seed, **options)
    except TypeError as error:
        raise InvalidValueError(f"scene '{name}' cannot take these options: {error}") from None
    from scenes.crowd import crowd_of
    from scenes.crowd_kinds import with_crowd
    from scenes.scene import Scene, at_scan_height

    scene = make(seed, **options)
    if not isinstance(scene, Scene):
        raise UnknownNameError(f"'{name}' is no recipe: it returned {type(scene).__name__}")
    return at_scan_height(with_crowd(scene, crowd_of(crowd)), scan_height_m)


def find(name: str) -> Recipe:
    """What makes the scene of that name; raises as ``build`` does for names."""
    if is_file(name):
        from scenes import from_file  # MuJoCo

        return from_file.recipe(name)
    refuse_code(name, "scene")
    return _load(name) if ":" in name else _find(name)


def check_name(name: str) -> None:
    """Raise what ``build`` raises for a name that nothing is registered under; import nothing."""
    if is_file(name):
        check_file(Path(name))
        return
    if ":" in name or name in OWN or name in _recipes:
        return
    raise UnknownNameError(
        f"no scene is called '{name}'.{meant(name, names())} Known: {', '.join(names())}, "
        "module:function, or a file (.toml, .xml)."
    )


def _find(name: str) -> Recipe:
    check_name(name)
    if name in _recipes:
        return _recipes[name]
    if name in _OURS:
        return _tabled(name)
    module, _, attribute = _DRAWN[name].partition(":")
    drawn: Recipe = getattr(importlib.import_module(module), attribute)
    return drawn


def _tabled(name: str) -> Recipe:
    """The recipe ``(seed, *, options) -> Scene`` of a table of ours."""
    row = _OURS[name]
    counts = {key: n for key, n in row.items() if key.startswith("n_")}
    known = {**dict.fromkeys(counts), **{key: _USUAL[key] for key in _USUAL if key in row}}

    def made(seed: int, **given: Any) -> "Scene":
        return _filled(name, seed, {**known, **given})

    options = [Parameter(key, Parameter.KEYWORD_ONLY, default=known[key]) for key in known]
    made.__doc__ = row["about"]
    made.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter("seed", Parameter.POSITIONAL_OR_KEYWORD), *options]
    )
    return made


def _filled(name: str, seed: int, options: dict[str, Any]) -> "Scene":
    from scenes.recipe import Draws, count, finish, furnished, planned
    from slam.shaped import one_of, shaped

    row = _OURS[name]
    for key in options:
        if key in row and key.startswith("n_"):
            options[key] = count(key, options[key], row[key])
    glass = shaped("glass", options.get("glass", False), bool)
    hidden = one_of("walls", options.get("walls", WALLS[0]), WALLS) == "none"
    plan = planned(
        name, tuple(row.get("furniture", ())), glazed=tuple(row["glass"] if glass else ()),
        hidden=hidden,
    )  # fmt: skip
    loads = {key[2:-1]: n for key, n in options.items() if key in ("n_pallets", "n_trolleys")}
    builder = furnished(
        plan, Draws(seed), options["n_chairs"], options["n_people"], options.get("doors", "open"),
        loads,
    )  # fmt: skip
    return finish(builder, name, seed, options)


def _load(entry: str) -> Recipe:
    module_name, _, attribute = entry.partition(":")
    join_folders()
    try:
        module = importlib.import_module(module_name)
    except (ImportError, ValueError) as error:  # ValueError: an empty module name
        raise UnknownNameError(f"'{entry}': cannot import '{module_name}' ({error})") from error
    recipe = getattr(module, attribute, None)
    if not callable(recipe):
        raise UnknownNameError(f"'{entry}': module '{module_name}' has no function '{attribute}'")
    return recipe  # type: ignore[no-any-return]
