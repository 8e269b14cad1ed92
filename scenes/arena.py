# SPDX-License-Identifier: Apache-2.0
"""The arena: one empty room full of chairs that get pushed about.

The smallest world in which the walls are the only thing to rely on, and the chairs hide them.
"""

from __future__ import annotations

from scenes.builder import Builder
from scenes.recipe import Draws, count, finish, free_floor, scatter, seat_chairs
from scenes.registry import register
from scenes.scene import Scene


@register("arena")
def arena(seed: int, *, n_chairs: int | None = None, n_people: int | None = None) -> Scene:
    """10 x 8 m, ``n_chairs`` (16) chairs anywhere, ``n_people`` (0) people."""
    options = {
        "n_chairs": count("n_chairs", n_chairs, 16),
        "n_people": count("n_people", n_people, 0),
    }
    draws = Draws(seed)
    builder = Builder("arena")
    start = next(builder.find("start")).pose
    floor = free_floor(builder, start)
    seat_chairs(builder, floor, (), options["n_chairs"], draws)
    scatter(builder, floor, "person", options["n_people"], draws, draws.people)
    return finish(builder, "arena", seed, start, options)
