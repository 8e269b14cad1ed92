# SPDX-License-Identifier: Apache-2.0
"""The classrooms: two rooms alike to the last chair, each full of thin legs."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned, switch
from scenes.registry import register
from scenes.scene import Scene

FURNITURE = ("school_desk", "desk", "bookshelf", "cabinet", "plant")


@register("classroom")
def classroom(
    seed: int,
    *,
    n_chairs: int | None = None,
    n_people: int | None = None,
    glass: bool = False,
    doors: str = "open",
) -> Scene:
    """18 x 10 m, two equal rooms and a corridor: ``n_chairs`` (34), ``n_people`` (4).

    ``glass``: panes instead of walls between the rooms and the corridor. ``doors``: how they
    rest, "open", "ajar", "closed" or "mixed".
    """
    n_chairs, n_people = count("n_chairs", n_chairs, 34), count("n_people", n_people, 4)
    glass = switch("glass", glass)
    plan = planned("classroom", FURNITURE, glazed=("hall_a", "hall_b") if glass else ())
    builder = furnished(plan, Draws(seed), n_chairs, n_people, doors)
    options = {"n_chairs": n_chairs, "n_people": n_people, "glass": glass, "doors": doors}
    return finish(builder, "classroom", seed, options)
