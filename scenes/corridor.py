# SPDX-License-Identifier: Apache-2.0
"""The corridor: 40 m of smooth walls, where a scanner sees no progress.

Scans along the middle are alike to the millimetre, so whatever matches them to a map is free to
slide along it; only odometry, and a niche near each end, tell places apart.
"""

from __future__ import annotations

from scenes.recipe import Draws, count, finish, furnished, planned
from scenes.registry import register
from scenes.scene import Scene


@register("corridor")
def corridor(seed: int, *, n_chairs: int | None = None, n_people: int | None = None) -> Scene:
    """40 x 2.4 m and featureless: ``n_chairs`` (4) chairs at its ends, ``n_people`` (2) people."""
    n_chairs, n_people = count("n_chairs", n_chairs, 4), count("n_people", n_people, 2)
    plan = planned("corridor", ("cabinet", "plant"))
    builder = furnished(plan, Draws(seed), n_chairs, n_people)
    return finish(builder, "corridor", seed, {"n_chairs": n_chairs, "n_people": n_people})
