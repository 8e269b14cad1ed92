# SPDX-License-Identifier: Apache-2.0
"""The office: a corridor, seven rooms, doors, desks, people on their way and chairs in theirs."""

from __future__ import annotations

from scenes.builder import Builder, Mark
from scenes.recipe import MARGIN, Draws, count, finish, free_floor, hang_doors, scatter, seat_chairs
from scenes.registry import register
from scenes.scene import Scene

FURNITURE = ("desk", "table", "bistro", "cabinet", "printer", "sofa", "plant")


@register("office")
def office(seed: int, *, n_chairs: int | None = None, n_people: int | None = None) -> Scene:
    """20 x 12 m, ``n_chairs`` (24) chairs at desks and tables, ``n_people`` (6) people."""
    options = {
        "n_chairs": count("n_chairs", n_chairs, 24),
        "n_people": count("n_people", n_people, 6),
    }
    draws = Draws(seed)
    builder = Builder("office")
    start = next(builder.find("start")).pose
    seats = _furnish(builder)
    hang_doors(builder, draws.doors)
    floor = free_floor(builder, start)
    _put_bins(builder, draws)
    for mover in builder.movers:
        if mover.kind == "bin":
            floor.block(*builder.initial[mover.name][:2], mover.radius)
    seat_chairs(builder, floor, seats, options["n_chairs"], draws)
    scatter(builder, floor, "person", options["n_people"], draws, draws.people)
    return finish(builder, "office", seed, start, options)


def _furnish(builder: Builder) -> list[Mark]:
    """All furniture of the plan; the seats it offers."""
    seats = list(builder.find("seat"))
    for part in FURNITURE:
        for index, mark in enumerate(builder.find(part)):
            seats += builder.furnish(part, f"{part}{index}", mark.pose)
    return seats


def _put_bins(builder: Builder, draws: Draws) -> None:
    """Bins stand within a hand's breadth of their mark, away from the wall."""
    for index, mark in enumerate(builder.find("bin")):
        shift = draws.bins.uniform(-MARGIN, MARGIN, 2).tolist()
        yaw = float(draws.bins.uniform(-3.0, 3.0))
        builder.add("bin", f"bin{index}", (mark.pose[0] + shift[0], mark.pose[1] + shift[1], yaw))
