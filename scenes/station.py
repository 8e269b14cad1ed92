# SPDX-License-Identifier: Apache-2.0
"""The station: a concourse with pillars and kiosks, streams of people, luggage trolleys."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned
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
    n_people = count("n_people", n_people, 12)
    plan, loads = planned("station", FURNITURE), {"trolley": n_trolleys}
    builder = furnished(plan, Draws(seed), n_chairs, n_people, loads=loads)
    options = {"n_trolleys": n_trolleys, "n_chairs": n_chairs, "n_people": n_people}
    return finish(builder, "station", seed, options)
