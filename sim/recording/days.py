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
from pathlib import Path

from scenes import build
from scenes.arrangement import opens_to
from scenes.scene import Pose, Scene
from sim.core.seeds import Seeds
from sim.recording.recipe import Recipe
from sim.recording.tables import POSE, pose_words, read_table, table
from sim.world.sessions import Arrangement, Days
from sim.world.times_of_day import MOST_SESSIONS, time_of
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


@dataclass(frozen=True, kw_only=True)
class Difference:
    """What became of a thing from one session to a later one.

    change  "stayed", "moved", "gone" (``after`` is None) or "new" (``before`` is None)
    """

    first: int
    second: int
    name: str
    kind: str
    change: str
    before: Pose | None
    after: Pose | None


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
        found += [
            Thing(
                session=session,
                time_of_day=time_of(session).name,
                name=name,
                kind=kinds[name],
                pose=pose,
            )
            for name, pose in poses.items()
        ]
    return found


def _poses(scene: Scene, arrangement: Arrangement) -> dict[str, Pose | None]:
    poses = dict(arrangement.poses)
    for name, angle in arrangement.angles.items():
        x, y, closed = scene.initial[name]
        poses[name] = (x, y, math.remainder(closed + opens_to(scene, name) * angle, math.tau))
    return poses


def differences(known: Sequence[Thing]) -> Iterator[Difference]:
    """What changed between any two sessions; what is out in both is left out."""
    sessions: dict[int, dict[str, Thing]] = {}
    for thing in known:
        sessions.setdefault(thing.session, {})[thing.name] = thing
    for first in sorted(sessions):
        for second in sorted(s for s in sessions if s > first):
            for name, thing in sessions[first].items():
                later = sessions[second].get(name)
                before, after = thing.pose, None if later is None else later.pose
                if before is None and after is None:
                    continue
                yield Difference(
                    first=first,
                    second=second,
                    name=name,
                    kind=thing.kind,
                    change=_change(before, after),
                    before=before,
                    after=after,
                )


def _change(before: Pose | None, after: Pose | None) -> str:
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
    changed = [
        (d.first, d.second, d.name, d.kind, d.change, *pose_words(d.before), *pose_words(d.after))
        for d in differences(known)
    ]
    write_text(folder / CHANGES, table(CHANGE_COLUMNS, changed))
    write_map(folder / "map", days.scene.static_map)


def read_things(folder: Path) -> list[Thing]:
    """``things.csv`` of a dataset; ``LogFormatError`` for anything else."""
    found = []
    known = set[tuple[int, str]]()
    for row in read_table(folder / THINGS, THING_COLUMNS):
        session = row.whole(0, MOST_SESSIONS - 1)
        time, name = row.one_of(1, (time_of(session).name,)), row.word(2)
        if (session, name) in known:
            raise row.error(f"session {session} has {name!r} twice")
        known.add((session, name))
        found.append(
            Thing(session=session, time_of_day=time, name=name, kind=row.word(3), pose=row.pose(4))
        )
    return found
