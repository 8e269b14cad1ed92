# SPDX-License-Identifier: Apache-2.0
"""Rooms and buildings: hand-readable MJCF parts and plans, put together by a seeded recipe each.

scene = scenes.build("office", seed=3, n_people=0)
model = scene.compile()
"""

from scenes.apartment import apartment
from scenes.arena import arena
from scenes.classroom import classroom
from scenes.corridor import corridor
from scenes.filled import filled
from scenes.mounting import at_scan_height
from scenes.office import office
from scenes.random_rooms import random_rooms
from scenes.registry import build, describe, names, register
from scenes.scene import SCAN_HEIGHT, Mover, Scene
from scenes.warehouse import warehouse

__all__ = [
    "SCAN_HEIGHT",
    "Mover",
    "Scene",
    "apartment",
    "arena",
    "at_scan_height",
    "build",
    "classroom",
    "corridor",
    "describe",
    "filled",
    "names",
    "office",
    "random_rooms",
    "register",
    "warehouse",
]
