# SPDX-License-Identifier: Apache-2.0
"""Rooms and buildings: hand-readable MJCF parts and plans, put together by a seeded recipe each.

scene = scenes.build("office", seed=3, n_people=0)
model = scene.compile()

The public names are imported when they are first asked for: ``import scenes`` alone loads no
physics engine.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenes.recipe import filled
    from scenes.registry import build, describe, names, register
    from scenes.scene import Mover, Scene, at_scan_height

SCAN_HEIGHT = 0.36
"""Usual height of the scan plane above the floor, m (where parts/robot.xml has its laser)."""
_WHERE = {
    **dict.fromkeys(("build", "describe", "names", "register"), "registry"),
    **dict.fromkeys(("Mover", "Scene", "at_scan_height"), "scene"),
    "filled": "recipe",
}

__all__ = [
    "SCAN_HEIGHT",
    "Mover",
    "Scene",
    "at_scan_height",
    "build",
    "describe",
    "filled",
    "names",
    "register",
]


def is_file(name: str) -> bool:
    """Whether a name of a scene is the path of its file."""
    return name.endswith((".toml", ".xml"))


def __getattr__(name: str) -> Any:
    """A public name, from the module that has it."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"scenes.{_WHERE[name]}"), name)
    return value


def __dir__() -> list[str]:
    """What there is, loaded or not."""
    return sorted({*globals(), *__all__})
