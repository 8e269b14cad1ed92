# SPDX-License-Identifier: Apache-2.0
"""The apartment: small furnished rooms, few chairs, four doors."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned
from scenes.registry import register
from scenes.scene import Scene

FURNITURE = (
    *("sofa", "coffee_table", "tv", "bookshelf", "cabinet", "plant", "kitchen", "dining"),
    *("bathtub", "toilet", "basin", "desk", "bed", "wardrobe"),
)


@register("apartment")
def apartment(
    seed: int, *, n_chairs: int | None = None, n_people: int | None = None, doors: str = "open"
) -> Scene:
    """12 x 9 m, seven rooms of a flat: ``n_chairs`` (6) chairs, ``n_people`` (2) people.

    ``doors``: how they rest, "open", "ajar", "closed" or "mixed".
    """
    n_chairs, n_people = count("n_chairs", n_chairs, 6), count("n_people", n_people, 2)
    builder = furnished(planned("apartment", FURNITURE), Draws(seed), n_chairs, n_people, doors)
    return finish(
        builder, "apartment", seed, {"n_chairs": n_chairs, "n_people": n_people, "doors": doors}
    )
