# SPDX-License-Identifier: Apache-2.0
"""The gallery: seven halls with exhibits and visitors, joined by openings as wide as a group."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned
from scenes.registry import register
from scenes.scene import Scene

EXHIBITS = ("pedestal", "plinth", "showcase", "panel", "relief")
FURNITURE = (*EXHIBITS, "bench", "desk", "cabinet", "plant")


@register("gallery")
def gallery(seed: int, *, n_chairs: int | None = None, n_people: int | None = None) -> Scene:
    """24 x 16 m, ``n_people`` (8) visitors, ``n_chairs`` (4) chairs of the guards."""
    n_chairs, n_people = count("n_chairs", n_chairs, 4), count("n_people", n_people, 8)
    builder = furnished(planned("gallery", FURNITURE), Draws(seed), n_chairs, n_people)
    return finish(builder, "gallery", seed, {"n_chairs": n_chairs, "n_people": n_people})
