# SPDX-License-Identifier: Apache-2.0
"""The office: a corridor, seven rooms, doors, desks, people on their way and chairs in theirs."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned, switch
from scenes.registry import register
from scenes.scene import Scene

FURNITURE = ("desk", "table", "bistro", "cabinet", "printer", "sofa", "plant")


@register("office")
def office(
    seed: int,
    *,
    n_chairs: int | None = None,
    n_people: int | None = None,
    glass: bool = False,
    doors: str = "open",
) -> Scene:
    """20 x 12 m, ``n_chairs`` (24) chairs at desks and tables, ``n_people`` (6) people.

    ``glass``: the parapet between meeting room and lounge is a pane of glass down to the floor.
    ``doors``: how they rest, "open", "ajar", "closed" or "mixed".
    """
    n_chairs, n_people = count("n_chairs", n_chairs, 24), count("n_people", n_people, 6)
    glass = switch("glass", glass)
    plan = planned("office", FURNITURE, glazed=("meeting_lounge",) if glass else ())
    builder = furnished(plan, Draws(seed), n_chairs, n_people, doors)
    options = {"n_chairs": n_chairs, "n_people": n_people, "glass": glass, "doors": doors}
    return finish(builder, "office", seed, options)
