# SPDX-License-Identifier: Apache-2.0
"""From the map of a robot to a plan of its building.

``plan(map, FromMap()) -> MapPlan`` finds walls, things, rooms, goals and doors;
``write(plan, stem)`` writes them as MJCF with a recipe beside it, whose path is a scene's name.
"""

from scenes.from_map.plan import FromMap, MapPlan, plan
from scenes.from_map.text import write

__all__ = ["FromMap", "MapPlan", "plan", "write"]
