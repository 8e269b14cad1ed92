# SPDX-License-Identifier: Apache-2.0
"""The station: a concourse with pillars and kiosks, streams of people, luggage trolleys."""

from __future__ import annotations

from functools import cache

from scenes.builder import Builder
from scenes.plan import Plan
from scenes.recipe import (
    Draws,
    count,
    finish,
    free_floor,
    hang_doors,
    park,
    put_bins,
    scatter,
    seat_chairs,
)
from scenes.registry import register
from scenes.scene import Scene

BUILT_IN = ("pillar", "kiosk", "ticket_machine", "lockers")
FURNITURE = (*BUILT_IN, "bench", "plant", "table", "bistro")


@register("station")
def station(
    seed: int,
    *,
    n_trolleys: int | None = None,
    n_chairs: int | None = None,
    n_people: int | None = None,
) -> Scene:
    """40 x 25 m: ``n_people`` (12), ``n_trolleys`` (4) for luggage, ``n_chairs`` (6)."""
    n_trolleys, n_chairs = count("n_trolleys", n_trolleys, 4), count("n_chairs", n_chairs, 6)
    n_people, draws = count("n_people", n_people, 12), Draws(seed)
    plan = _plan()
    builder = Builder(plan)
    hang_doors(builder, draws.doors)
    put_bins(builder, draws.bins)
    floor = free_floor(builder)
    seat_chairs(builder, floor, plan.seats, n_chairs, draws)
    park(builder, floor, "trolley", n_trolleys, draws.cargo)
    scatter(builder, floor, "person", n_people, draws, draws.people)
    options = {"n_trolleys": n_trolleys, "n_chairs": n_chairs, "n_people": n_people}
    return finish(builder, "station", seed, options)


@cache
def _plan() -> Plan:
    plan = Plan("station")
    plan.furnish_marks(FURNITURE)
    return plan.finish()
