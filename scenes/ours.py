# SPDX-License-Identifier: Apache-2.0
"""The scenes that come with the project: a plan of ``scenes/plans`` and a table of ``ours.toml``.

``random-rooms`` is a recipe in Python: it draws its plan.
"""

import tomllib
from collections.abc import Callable
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # it loads MuJoCo, and names are checked before that
    from scenes.scene import Scene

ROWS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)
WALLS = ("visible", "none")
_USUAL = {"walls": WALLS[0], "glass": False, "doors": "open"}


def recipe(name: str) -> "Callable[..., Scene]":
    """The recipe ``(seed, *, options) -> Scene`` of a row."""
    row = ROWS[name]
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

    row = ROWS[name]
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
