# SPDX-License-Identifier: Apache-2.0
"""Truth of a dataset of sessions: where everything stands in each, what changed between any two.

``things.csv``   a row for each session and thing
``changes.csv``  a row for each two sessions and thing: stayed, moved, gone or new
``map.pgm``, ``map.yaml``  what never moves

Poses are in the frame of the map and of ``/ground_truth/objects``, as of the start of the session;
a door stands at its hinge and heads along its leaf.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from scenes import build
from scenes.arrangement import opens_to
from scenes.scene import Pose, Scene
from sim.core.seeds import Seeds
from sim.recording.recipe import Recipe
from sim.recording.tables import POSE, pose_words, table
from sim.world.sessions import Arrangement, Days
from sim.world.times_of_day import time_of
from slam.files import write_text
from slam.maps import write_map

THINGS, CHANGES = "things.csv", "changes.csv"
FILES = (THINGS, CHANGES, "map.pgm", "map.yaml")
STAYED_M, STAYED_RAD = 0.05, 0.1  # what differs by less has stayed
THING_COLUMNS = ("session", "time_of_day", "name", "kind", *POSE)
CHANGE_COLUMNS = (
    "from_session", "to_session", "name", "kind", "change",
    *(f"from_{c}" for c in POSE), *(f"to_{c}" for c in POSE),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Thing:
    """A thing in a session: ``pose`` m, m, rad in the world; None while out of the building."""

    session: int
    time_of_day: str
    name: str
    kind: str
    pose: Pose | None


def days_of(recipe: Recipe) -> Days:
    """The building of a recipe that has a session."""
    seeds = Seeds(recipe.seed)
    scene = build(recipe.scene, seed=seeds.integer("layout"), **recipe.options)
    return Days(scene, seeds, recipe.share_changed)


def things(days: Days, sessions: int) -> list[Thing]:
    """Where everything stands in the first so many sessions."""
    found = []
    kinds = {m.name: m.kind for m in days.scene.movers}
    for session in range(sessions):
        poses = _poses(days.scene, days.arrangement(session))
        time = time_of(session).name
        found += [
            Thing(session=session, time_of_day=time, name=name, kind=kinds[name], pose=pose)
            for name, pose in poses.items()
        ]
    return found


def _poses(scene: Scene, arrangement: Arrangement) -> dict[str, Pose | None]:
    poses = dict(arrangement.poses)
    for name, angle in arrangement.angles.items():
        x, y, closed = scene.initial[name]
        poses[name] = (x, y, math.remainder(closed + opens_to(scene, name) * angle, math.tau))
    return poses


def _differences(known: Sequence[Thing]) -> Iterator[tuple[object, ...]]:
    """Rows of what became of things between any two sessions; what is out in both is left out."""
    sessions: dict[int, dict[str, Thing]] = {}
    for thing in known:
        sessions.setdefault(thing.session, {})[thing.name] = thing
    for first, second in combinations(sorted(sessions), 2):
        for name, thing in sessions[first].items():
            later = sessions[second].get(name)
            before, after = thing.pose, None if later is None else later.pose
            if before is not None or after is not None:
                poses = (*pose_words(before), *pose_words(after))
                yield first, second, name, thing.kind, _change(before, after), *poses


def _change(before: Pose | None, after: Pose | None) -> str:
    """One of "stayed", "moved", "gone" or "new"."""
    if before is None or after is None:
        return "new" if before is None else "gone"
    turned = abs(math.remainder(after[2] - before[2], math.tau))
    near = math.dist(before[:2], after[:2]) < STAYED_M and turned < STAYED_RAD
    return "stayed" if near else "moved"


def write_days(folder: Path, recipe: Recipe, sessions: int) -> None:
    """All ``FILES`` of a dataset whose sessions have that recipe but for their number."""
    days = days_of(recipe)
    known = things(days, sessions)
    rows = [(t.session, t.time_of_day, t.name, t.kind, *pose_words(t.pose)) for t in known]
    write_text(folder / THINGS, table(THING_COLUMNS, rows))
    write_text(folder / CHANGES, table(CHANGE_COLUMNS, _differences(known)))
    write_map(folder / "map", days.scene.static_map)
