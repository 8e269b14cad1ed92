# SPDX-License-Identifier: Apache-2.0
"""Steps the recipes share: seeded streams, counts, chairs, people, doors, the finished Scene.

``filled`` is the recipe of a plan alone; ``arena``, ``office`` and the others have options of their
own.
"""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from scenes import look
from scenes.assembly import part, reach_of
from scenes.builder import Builder
from scenes.kinds import KINDS, kind_of
from scenes.marks import Mark
from scenes.placement import Floor
from scenes.plan import Plan, furniture
from scenes.scene import Kind, Pose, Scene
from slam.errors import InvalidValueError
from slam.shaped import one_of, shaped

MARGIN = 0.03  # m between things at the start
DOORWAY_RADIUS = 0.65  # m kept clear around the middle of a doorway
GOAL_RADIUS = 0.45  # m of free floor around a goal
START_RADIUS = 0.7  # m of free floor around the robot
# rad; by default doors rest open, so that every room can be reached at dynamism 0
REST_ANGLES = {"open": (1.25, 1.75), "ajar": (0.3, 0.9), "closed": (0.0, 0.0)}
DOORS = (*REST_ANGLES, "mixed")
Count = Annotated[int, Meta(ge=0, le=400)]
Spread = tuple[tuple[float, float], float, float]
PULLED: Spread = ((0.0, 0.25), 0.12, 0.5)  # a chair: m back (least, most), m sideways, rad turned
ASKEW: Spread = ((-0.12, 0.12), 0.08, 0.12)  # a trolley or pallet

_STREAMS = ("chairs", "people", "doors", "bins", "colours", "cargo", "rooms")


class Draws:
    """One generator per subject, so that one more person does not move the chairs."""

    def __init__(self, seed: int) -> None:
        streams = [np.random.default_rng([seed, index]) for index in range(len(_STREAMS))]
        self.chairs, self.people, self.doors, self.bins, self.colours = streams[:5]
        self.cargo, self.rooms = streams[5:]


def count(field: str, value: int | None, default: int) -> int:
    """An option that counts things, or its default for None."""
    return default if value is None else int(shaped(field, value, Count))


def free_floor(builder: Builder) -> Floor:
    """The rooms' floor less furniture, doorways, open leaves, goals, movers, the robot's start."""
    plan = builder.plan
    boxes = np.vstack([plan.boxes, builder.leaf_boxes()])
    floor = Floor([mark.rect for mark in plan.find("room")], boxes)
    for name in builder.door_angles:
        x, y, _ = builder.doorway(name)
        floor.block(x, y, DOORWAY_RADIUS)
    for opening in plan.find("opening"):
        floor.block(*opening.pose[:2], DOORWAY_RADIUS)
    floor.block(plan.start[0], plan.start[1], START_RADIUS)
    for goal in plan.find("goal"):
        floor.block(goal.pose[0], goal.pose[1], GOAL_RADIUS)
    for mover in builder.movers:
        if mover.group != "door":
            floor.block(*builder.initial[mover.name][:2], reach_of(mover.kind))
    return floor


def hang_doors(builder: Builder, rng: np.random.Generator, doors: str = "open") -> None:
    """A door at each ``door:ROOM:left|right`` mark, whose closer brings it to a seeded angle.

    Sliding doors, at marks of their own, rest closed.

    doors  "open" (held open), "ajar", "closed", or "mixed": each door one of the three
    """
    one_of("doors", doors, DOORS)
    for index, mark in enumerate(builder.plan.find("door")):
        rest = str(rng.choice(list(REST_ANGLES))) if doors == "mixed" else doors
        angle = float(rng.uniform(*REST_ANGLES[rest]))
        builder.add_door(
            f"door{index}", mark.pose, clockwise=mark.words[2] == "right", angle=round(angle, 3)
        )
    hang_sliding_doors(builder)


def hang_sliding_doors(builder: Builder) -> None:
    """A closed one at each ``sliding:...`` and ``lift:...`` mark, numbered on after the others."""
    for first, kind in (("sliding", "door_sliding"), ("lift", "door_lift")):
        for mark in builder.plan.find(first):
            name = f"door{len(builder.door_angles)}"
            builder.add_sliding_door(kind, name, mark.pose, left=mark.words[2] == "left")


def seat_chairs(
    builder: Builder, floor: Floor, seats: Sequence[Mark], more: int, draws: Draws
) -> None:
    """So many more chairs: a seeded choice of seats, pulled out a little and turned; the rest
    anywhere."""
    n = more + sum(m.group == "chair" for m in builder.movers)
    order = draws.chairs.permutation(len(seats))[:more]
    for index in sorted(order.tolist()):
        said = seats[index].words[1]
        kind = said if said in KINDS else "chair_swivel"
        pose = _askew(floor, seats[index].pose, reach_of(kind) + MARGIN, draws.chairs, PULLED)
        if pose is not None:
            _add_chair(builder, floor, kind, pose, draws)
    while sum(m.group == "chair" for m in builder.movers) < n:
        kind = _usual_chair(float(draws.chairs.random()))
        pose = _anywhere(floor, kind, "n_chairs", n, draws.chairs)
        _add_chair(builder, floor, kind, pose, draws)


def _usual_chair(luck: float) -> Kind:
    """A kind of chair for a number in [0, 1)."""
    kinds = [kind for kind, row in KINDS.items() if row.usual > 0.0]
    shares = np.cumsum([KINDS[kind].usual for kind in kinds])
    return kinds[int(np.searchsorted(shares, luck * shares[-1], side="right"))]


def park(builder: Builder, floor: Floor, kind: Kind, n: int, rng: np.random.Generator) -> None:
    """``n`` things on a seeded choice of ``spot:KIND:N`` marks, somewhat askew; others anywhere."""
    spots = [mark for mark in builder.plan.find("spot") if mark.words[1] == kind]
    radius = reach_of(kind) + MARGIN
    chosen = [spots[i] for i in sorted(rng.permutation(len(spots))[:n].tolist())]
    for index in range(n):
        pose = None
        if index < len(chosen):
            pose = _askew(floor, chosen[index].pose, radius, rng, ASKEW)
        pose = pose or _anywhere(floor, kind, f"n_{kind}s", n, rng)
        builder.add(kind, f"{kind}{index}", pose)
        floor.block(pose[0], pose[1], reach_of(kind))


def scatter(
    builder: Builder, floor: Floor, kind: Kind, n: int, draws: Draws, rng: np.random.Generator
) -> None:
    """``n`` people (or others) on free floor anywhere."""
    for index in range(n):
        field = "n_people" if kind == "person" else f"n_{kind}s"
        pose = _anywhere(floor, kind, field, n, rng)
        paint = look.dress(draws.colours) if kind == "person" else None
        builder.add(kind, f"{kind}{index}", pose, paint=paint)
        floor.block(pose[0], pose[1], reach_of(kind))


@cache
def planned(
    name: str,
    parts: tuple[str, ...] = (),
    *,
    put: tuple[tuple[str, Pose], ...] = (),
    glazed: tuple[str, ...] = (),
    hidden: bool = False,
) -> Plan:
    """A plan of ``scenes/plans``, or the path of one, with its furniture and the frames of doors.

    parts   put wherever a mark starts with their name; ``put``: also where no mark is
    glazed  walls that are panes; ``hidden``: nobody sees the walls
    """
    plan = Plan(name)
    if hidden:
        plan.hide_walls()
    plan.furnish_marks(parts)
    for piece, pose in put:
        plan.furnish(piece, pose)
    plan.frame_doors()
    for wall in glazed:
        plan.glaze(wall)
    return plan.finish()


def furnished(
    plan: Plan,
    draws: Draws,
    n_chairs: int,
    n_people: int,
    doors: str = "open",
    loads: Mapping[Kind, int] | None = None,
) -> Builder:
    """Rooms with doors, bins and what the plan puts at its marks, chairs at the seats, loads by
    kind at their spots, and people anywhere."""
    builder = Builder(plan)
    hang_doors(builder, draws.doors, doors)
    put_bins(builder, draws.bins)
    put_movers(builder, plan.put)
    builder.check_apart()
    floor = free_floor(builder)
    seat_chairs(builder, floor, plan.seats, n_chairs, draws)
    for kind, n in (loads or {}).items():
        park(builder, floor, kind, n, draws.cargo)
    scatter(builder, floor, "person", n_people, draws, draws.people)
    return builder


def put_bins(builder: Builder, rng: np.random.Generator) -> None:
    """A bin within a hand's breadth of each ``bin:...`` mark, away from the wall."""
    for index, mark in enumerate(builder.plan.find("bin")):
        shift = rng.uniform(-MARGIN, MARGIN, 2).tolist()
        yaw = float(rng.uniform(-3.0, 3.0))
        builder.add("bin", f"bin{index}", (mark.pose[0] + shift[0], mark.pose[1] + shift[1], yaw))


def put_movers(builder: Builder, movers: Sequence[tuple[str, Pose]]) -> None:
    """Things that can move, by kind and pose; chairs of all kinds are "chair0", "chair1", ..."""
    for kind, pose in movers:
        name = "chair" if KINDS[kind].group == "chair" else kind
        n = sum(m.name.rstrip("0123456789") == name for m in builder.movers)
        builder.add(kind, f"{name}{n}", pose)


def finish(builder: Builder, name: str, seed: int, options: Mapping[str, object]) -> Scene:
    """Robot and facts."""
    plan = builder.plan
    builder.add("robot", "robot", plan.start)
    return Scene(
        name=name,
        seed=seed,
        spec=builder.spec(),
        movers=tuple(builder.movers),
        initial=dict(builder.initial),
        door_angles=dict(builder.door_angles),
        goals={mark.words[1]: (mark.pose[0], mark.pose[1]) for mark in plan.find("goal")},
        rooms={mark.words[1]: mark.rect for mark in plan.find("room")},
        bounds=plan.bounds,
        obstacles=plan.boxes,
        start=plan.start,
        options=dict(options),
        places=_places(plan),
        plan_file=plan.file,
    )


def _places(plan: Plan) -> tuple[tuple[str, Pose], ...]:
    """Seats, spots and places of bins by the kind that stands there, and openings."""
    found = [(mark.words[1], mark.pose) for mark in (*plan.seats, *plan.find("spot"))]
    found += [("bin", mark.pose) for mark in plan.find("bin")]
    return (*found, *(("opening", mark.pose) for mark in plan.find("opening")))


def _add_chair(builder: Builder, floor: Floor, kind: Kind, pose: Pose, draws: Draws) -> None:
    index = sum(m.group == "chair" for m in builder.movers)
    cloth = any(geom.material == look.CLOTH for geom in part(kind).geoms)
    paint = look.upholster(draws.colours) if cloth else None
    builder.add(kind, f"chair{index}", pose, paint=paint)
    floor.block(pose[0], pose[1], reach_of(kind))


def _askew(
    floor: Floor, pose: Pose, radius: float, rng: np.random.Generator, spread: Spread
) -> Pose | None:
    """``pose``, shifted back and sideways and turned, where there is room; else as is, or None."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    (least, most), sideways, turning = spread
    for _ in range(8):
        low, high = [least, -sideways, -turning], [most, sideways, turning]
        back, side, turn = rng.uniform(low, high).tolist()
        place = (x - cos * back - sin * side, y - sin * back + cos * side, yaw + turn)
        if floor.fits(place[0], place[1], radius):
            return place
    return pose if floor.fits(x, y, radius) else None


def _anywhere(floor: Floor, kind: Kind, field: str, n: int, rng: np.random.Generator) -> Pose:
    place = floor.find(rng, reach_of(kind) + MARGIN)
    if place is None:
        raise InvalidValueError(f"{field} = {n} does not fit on the floor of this scene")
    return place[0], place[1], float(rng.uniform(-math.pi, math.pi))


def filled(  # noqa: PLR0913 (the counts of a scene, each by name)
    plan: str | Path,
    seed: int,
    *,
    parts: Sequence[str | Path] = (),
    put: Sequence[tuple[str | Path, Pose]] = (),
    n_chairs: int = 0,
    n_people: int = 0,
    loads: Mapping[str, int] | None = None,
    doors: str = "open",
) -> Scene:
    """The scene of a plan: furniture, doors and bins at its marks, then chairs and people.

    plan    path of an MJCF file, or the name of one of ``scenes/plans``
    parts   paths of MJCF files of furniture: each is put wherever a mark starts with its name
    put     furniture where no mark is: (path or name, (x m, y m, yaw rad)), its back to +y
    loads   how many of each kind that is pushed about, ``spot:KIND:N`` marks first: {"trolley": 2}
    doors   how they rest: "open", "ajar", "closed" or "mixed"

    Chairs take the ``seat:...`` marks first, then free floor. Raises ``InvalidValueError`` for a
    file, mark, material or number that cannot be, ``UnknownNameError`` for a kind of load.
    """
    n_chairs, n_people = count("n_chairs", n_chairs, 0), count("n_people", n_people, 0)
    more = tuple((str(part), (pose[0], pose[1], pose[2])) for part, pose in put)
    walls = planned(str(plan), (*map(str, parts), *furniture()), put=more)
    for kind in loads or {}:
        kind_of(kind)  # an unknown one is refused with the kinds that there are
    loaded = {kind: count(f"loads[{kind!r}]", n, 0) for kind, n in (loads or {}).items()}
    builder = furnished(walls, Draws(seed), n_chairs, n_people, doors, loaded)
    options: dict[str, object] = {"n_chairs": n_chairs, "n_people": n_people, "doors": doors}
    options |= {"loads": dict(loads)} if loads else {}
    return finish(builder, Path(plan).stem, seed, options)
