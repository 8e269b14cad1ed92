# SPDX-License-Identifier: Apache-2.0
"""Rooms and buildings: hand-readable MJCF parts and plans, put together by a seeded recipe each.

scene = scenes.build("office", seed=3, n_people=0)
model = scene.compile()
"""

from scenes.arena import arena
from scenes.office import office
from scenes.registry import build, names, register
from scenes.scene import SCAN_HEIGHT, Mover, Scene

__all__ = ["SCAN_HEIGHT", "Mover", "Scene", "arena", "build", "names", "office", "register"]
