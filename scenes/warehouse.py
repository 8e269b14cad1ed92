# SPDX-License-Identifier: Apache-2.0
"""The warehouse: aisles between racks that all look alike, pallets and trolleys that get moved."""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned
from scenes.registry import register
from scenes.scene import Scene

FURNITURE = ("rack_a", "rack_b", "rack_c", "desk", "cabinet")


@register("warehouse")
def warehouse(
    seed: int,
    *,
    n_trolleys: int | None = None,
    n_pallets: int | None = None,
    n_chairs: int | None = None,
    n_people: int | None = None,
) -> Scene:
    """24 x 16 m: ``n_trolleys`` (8), ``n_pallets`` (14), ``n_people`` (4), ``n_chairs`` (2)."""
    n_trolleys, n_pallets = count("n_trolleys", n_trolleys, 8), count("n_pallets", n_pallets, 14)
    n_chairs, n_people = count("n_chairs", n_chairs, 2), count("n_people", n_people, 4)
    loads = {"pallet": n_pallets, "trolley": n_trolleys}
    plan = planned("warehouse", FURNITURE)
    builder = furnished(plan, Draws(seed), n_chairs, n_people, loads=loads)
    options = {
        "n_trolleys": n_trolleys,
        "n_pallets": n_pallets,
        "n_chairs": n_chairs,
        "n_people": n_people,
    }
    return finish(builder, "warehouse", seed, options)
