# SPDX-License-Identifier: Apache-2.0
"""Tables of truth, CSV: of an episode, and of a dataset of sessions.

A pose is three fields, x m, y m and heading rad; all three empty: out of the building.
``rearranged.csv`` has what was put elsewhere out of sight. Relations are those of Kümmerle et
al. 2009 ("On measuring the accuracy of SLAM algorithms", Autonomous Robots 27), here from the
truth: a line is ``t1 t2 x y z roll pitch yaw``, the pose at t2 as seen from that at t1, so that the
metric needs no common frame.

``things.csv`` has a row for each session and thing, ``changes.csv`` for each two sessions and
thing: stayed, moved, gone or new. Both are as of the start of the session, in the frame of the map
and of ``/ground_truth/objects``; a door stands at its hinge and heads along its leaf.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from scenes import build
from scenes.arrangement import opens_to
from scenes.scene import Pose, Scene
from sim.actors.rearranging import Rearrangement, is_out
from sim.core.seeds import Seeds
from sim.recording.recipe import Recipe
from sim.world.sessions import Arrangement, Days
from sim.world.times_of_day import time_of
from slam import se2
from slam.files import cell_of, write_text
from slam.frames import NS_PER_S
from slam.maps import write_map
from slam.trajectory import Trajectory

POSE = ("x_m", "y_m", "heading_rad")


def pose_words(pose: Pose | None) -> tuple[str, ...]:
    """The three fields of a pose."""
    return ("", "", "") if pose is None else tuple(f"{value:.6f}" for value in pose)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """The text of a file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([cell_of(c) if isinstance(c, str) else c for c in row] for row in rows)
    return text.getvalue()


REARRANGED = "rearranged.csv"
COLUMNS = ("time_s", "name", "change", *(f"from_{c}" for c in POSE), *(f"to_{c}" for c in POSE))
Rect = tuple[float, float, float, float]


def write_rearranged(path: Path, events: Sequence[Rearrangement], bounds: Rect) -> None:
    """A row for each thing put elsewhere, in order; times in s since the start, poses m, m, rad."""
    rows = []
    for event in events:
        poses = [None if is_out(np.array(p), bounds) else p for p in (event.before, event.after)]
        words = (word for pose in poses for word in pose_words(pose))
        rows.append((f"{event.time_s:.6f}", event.name, event.change, *words))
    write_text(path, table(COLUMNS, rows))


STEP_NS = NS_PER_S  # between the poses that are related
FAR = 10  # steps: the second kind of relation, and the least before a place is seen again
NEAR_M = 1.0  # to a pose before that: a place seen again


def pairs(trajectory: Trajectory) -> list[tuple[int, int]]:
    """Indices (i, j): neighbours a second apart, ten seconds apart, and places seen again."""
    chosen: list[int] = []
    for k, stamp_ns in enumerate(trajectory.stamps_ns.tolist()):
        if not chosen or stamp_ns - int(trajectory.stamps_ns[chosen[-1]]) >= STEP_NS:
            chosen.append(k)
    positions = trajectory.poses[chosen, :2].tolist()
    out = []
    for b in range(1, len(chosen)):
        out.append((chosen[b - 1], chosen[b]))
        if b < FAR:
            continue
        out.append((chosen[b - FAR], chosen[b]))
        seen = [(math.dist(positions[a], positions[b]), a) for a in range(b - FAR)]
        if seen and min(seen)[0] < NEAR_M:
            out.append((chosen[min(seen)[1]], chosen[b]))
    return out


def write_relations(path: Path, truth: Trajectory) -> None:
    """One line for each of ``pairs``."""
    lines = []
    for i, j in pairs(truth):
        x, y, yaw = se2.between(truth.poses[i], truth.poses[j]).tolist()
        times = f"{_seconds(truth, i)} {_seconds(truth, j)}"
        lines.append(f"{times} {x:.9f} {y:.9f} 0 0 0 {yaw:.12f}\n")
    write_text(path, "".join(lines))


def _seconds(trajectory: Trajectory, k: int) -> str:
    seconds, nanoseconds = divmod(int(trajectory.stamps_ns[k]), NS_PER_S)
    return f"{seconds}.{nanoseconds:09d}"


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
    # the building of a recipe that has a session
    seeds = Seeds(recipe.seed)
    scene = build(recipe.scene, seed=seeds.integer("layout"), **recipe.options)
    days = Days(scene, seeds, recipe.share_changed)
    known = things(days, sessions)
    rows = [(t.session, t.time_of_day, t.name, t.kind, *pose_words(t.pose)) for t in known]
    write_text(folder / THINGS, table(THING_COLUMNS, rows))
    write_text(folder / CHANGES, table(CHANGE_COLUMNS, _differences(known)))
    write_map(folder / "map", days.scene.static_map)
