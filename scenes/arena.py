# SPDX-License-Identifier: Apache-2.0
"""The arena: one empty room full of chairs that get pushed about.

The smallest world in which the walls are the only thing to rely on, and the chairs hide them.
Without walls (``walls="none"``) there is nothing to rely on at all: they still hold the chairs in,
but no ray meets them, no camera sees them and the true map is empty, as if the room were wider than
the laser reaches.
"""

from __future__ import annotations

from scenes.recipe import Draws, choice, count, finish, furnished, planned
from scenes.registry import register
from scenes.scene import Scene

WALLS = ("visible", "none")


@register("arena")
def arena(
    seed: int, *, n_chairs: int | None = None, n_people: int | None = None, walls: str = "visible"
) -> Scene:
    """10 x 8 m, ``n_chairs`` (16) chairs anywhere, ``n_people`` (0) people.

    ``walls``: "visible", or "none" for walls that stop chairs but that nobody can see.
    """
    n_chairs = count("n_chairs", n_chairs, 16)
    n_people = count("n_people", n_people, 0)
    walls = choice("walls", walls, WALLS)
    plan = planned("arena", hidden=walls == "none")
    builder = furnished(plan, Draws(seed), n_chairs, n_people)
    options = {"n_chairs": n_chairs, "n_people": n_people, "walls": walls}
    return finish(builder, "arena", seed, options)
