# SPDX-License-Identifier: Apache-2.0
"""Where each kind of a crowd is put, and what its people do there.

All are put on the free floor of the finished scene, from a stream of randomness of their own: what
else is in the scene stays as it is. What they do is ``Role`` and ``Hold``; ``sim.actors.people``
carries it out.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, replace

import numpy as np

from scenes import look
from scenes.assembly import Assembly, discs_of, hull_radius, moved
from scenes.crowd import GROUP, Crowd
from scenes.kinds import kind_of
from scenes.placement import Floor
from scenes.recipe import DOORWAY_RADIUS, GOAL_RADIUS, MARGIN
from scenes.scene import Hold, Mover, Pose, Role, Scene
from slam.errors import InvalidValueError

TRIES = 400
_STREAM = 100  # of a scene's seed; those of ``scenes.recipe.Draws`` are 0 to 6


class Filling:
    """A scene that is being filled."""

    def __init__(self, scene: Scene, crowd: Crowd, session: int) -> None:
        self.scene, self.crowd = scene, crowd
        self.rng = np.random.default_rng([scene.seed, _STREAM, session])
        self.parts = Assembly()
        self.movers: list[Mover] = []
        self.initial: dict[str, Pose] = {}
        self.roles: dict[str, Role] = {}
        self.holds: list[Hold] = []
        self.floor = _free_floor(scene, list(scene.rooms.values()))
        self.halls = _free_floor(scene, _halls(scene))

    def fits(self, discs: list[tuple[float, float, float]]) -> bool:
        """Whether each disc (x, y, radius m) lies in a room, on free floor."""
        points = np.array([disc[:2] for disc in discs])
        gaps = self.floor.clearance(points)
        inside = all(self._indoors(*disc) for disc in discs)
        return inside and bool((gaps >= np.array([disc[2] for disc in discs]) + MARGIN).all())

    def _indoors(self, x: float, y: float, radius: float) -> bool:
        return any(
            a + radius <= x <= c - radius and b + radius <= y <= d - radius
            for a, b, c, d in self.scene.rooms.values()
        )

    def add(self, kind: str, name: str, pose: Pose) -> None:
        """Put a mover at a pose and take its floor."""
        paint = look.dress(self.rng) if kind_of(kind).group == "person" else {}
        self.movers.append(self.parts.put_mover(kind, name, pose, paint))
        self.initial[name] = pose
        self.block(discs_of(kind, pose))

    def block(self, discs: list[tuple[float, float, float]]) -> None:
        """Take floor."""
        for disc in discs:
            self.floor.block(*disc)
            self.halls.block(*disc)

    def anywhere(self, kinds: list[tuple[str, Pose]], what: str) -> list[Pose]:
        """Poses of a rigid set of things, given in the first one's frame, where all have room.

        What is long stands in a hall, where the scene has one.
        """
        floor = self.floor if len(kinds) == 1 else self.halls
        for _ in range(TRIES):
            place = floor.find(self.rng, hull_radius(kinds[0][0]) + MARGIN)
            if place is None:
                break
            first = (*place, float(self.rng.uniform(-math.pi, math.pi)))
            poses = [moved(first, local) for _, local in kinds]
            discs = [
                d for (kind, _), p in zip(kinds, poses, strict=True) for d in discs_of(kind, p)
            ]
            if self.fits(discs):
                return poses
        raise InvalidValueError(f"crowd: {what} does not fit on the floor of '{self.scene.name}'")

    def put(self, named: list[tuple[str, str, Pose]], what: str) -> None:
        """Put a rigid set of things (kind, name, pose in the first one's frame) anywhere."""
        poses = self.anywhere([(kind, local) for kind, _, local in named], what)
        for (kind, name, _), pose in zip(named, poses, strict=True):
            self.add(kind, name, pose)

    def finish(self) -> Scene:
        """The scene with all that was put into it; its spec is filled, which saves a copy."""
        scene = self.scene
        self.parts.into(scene.spec)
        return replace(
            scene,
            movers=(*scene.movers[:-1], *self.movers, scene.movers[-1]),
            initial={**scene.initial, **self.initial},
            roles=dict(self.roles),
            holds=tuple(self.holds),
            options={**scene.options, "crowd": str(self.crowd)},
        )


def reach_of(kind: str) -> float:
    """m from the middle of a thing to the end of its hulls, along its x axis."""
    return kind_of(kind).half_length_m + hull_radius(kind)


def _halls(scene: Scene) -> list[tuple[float, float, float, float]]:
    """Rooms with two goals or more, between which long things move; all, where there is none."""
    inside = {
        name: sum(a <= x <= c and b <= y <= d for x, y in scene.goals.values())
        for name, (a, b, c, d) in scene.rooms.items()
    }
    halls = [scene.rooms[name] for name, n in inside.items() if n > 1]
    return halls or list(scene.rooms.values())


def _free_floor(scene: Scene, rects: list[tuple[float, float, float, float]]) -> Floor:
    """The floor of rooms less furniture, doorways, goals and everything that is there already."""
    floor = Floor(rects, scene.obstacles)
    for mover in scene.movers:
        x, y, yaw = scene.initial[mover.name]
        if mover.group == "door":
            middle = moved((x, y, yaw), (0.5 * mover.radius, 0.0, 0.0))
            floor.block(middle[0], middle[1], DOORWAY_RADIUS + 0.5 * mover.radius)
        else:
            for cx, cy, radius in discs_of(mover.kind, (x, y, yaw)):
                floor.block(cx, cy, radius + (0.2 if mover.group == "robot" else 0.0))
    for x, y in scene.goals.values():
        floor.block(x, y, GOAL_RADIUS)
    return floor


BESIDE = 0.05  # m between a person's hull and that of what is held
QUEUE_M = 0.75  # from one to the next
WAGONS = 2  # of a train
ROW = 4  # chairs in a row at a wall
CHAIR_M = 0.68  # from one to the next: hulls of 0.29 m and a hand's breadth
ROW_WALL, ROW_BEFORE = 0.08, 0.4  # m, behind a row and before it
COAT = "person_coat"  # what accompanies the robot is dressed for a tour in winter


def with_crowd(
    scene: Scene, crowd: Crowd, session: int = 0, *, as_many_as_fit: bool = False
) -> Scene:
    """The scene with a crowd in it, another one each session; the given scene is used up.

    Raises ``InvalidValueError`` where it does not fit on the floor, unless ``as_many_as_fit`` will
    do: of each kind up to the first that has no room.
    """
    if not crowd:
        return scene
    filling = Filling(scene, crowd, session)
    for each in fields(crowd):
        try:
            if getattr(crowd, each.name):
                _PUT[each.name](filling, getattr(crowd, each.name))
        except InvalidValueError:
            if not as_many_as_fit:
                raise
    return filling.finish()


def slots(n: int) -> Iterator[tuple[float, float]]:
    """Where ``n`` escorts go, (m ahead, m left) of the robot: before it, beside it, in file.

    The first are in a half ring before it, with a gap to drive into; every fifth goes in file.
    """
    ring = [(1.1, 0.75), (1.7, 0.45), (1.7, 0.9), (1.1, 1.25), (2.3, 0.35), (2.3, 0.7)]
    ring += [(1.1, 1.75), (2.3, 1.05), (1.7, 1.35), (1.7, 1.75)]
    at = behind = 0
    for k in range(n):
        if k % 5 == 4 or at == 2 * len(ring):
            yield -0.95 - 0.7 * behind, 0.0
            behind += 1
        else:
            distance, angle = ring[at // 2]
            angle = -angle if at % 2 else angle
            yield distance * math.cos(angle), distance * math.sin(angle)
            at += 1


def _escorts(filling: Filling, n: int) -> None:
    x, y, yaw = filling.scene.start
    for k, slot in enumerate(slots(n)):
        pose = moved((x, y, yaw), (*slot, 0.0))
        if not filling.fits(discs_of(COAT, pose)):
            pose = _near(filling, x, y)
        filling.add(COAT, f"escort{k}", pose)
        filling.roles[f"escort{k}"] = Role(does="follow", leader="robot", slot=slot)


def _near(filling: Filling, x: float, y: float) -> Pose:
    """A free pose as near to (x, y) as a few hundred tries find."""
    for k in range(TRIES):
        reach = 1.2 + 0.02 * k
        angle, far = filling.rng.uniform(-math.pi, math.pi), filling.rng.uniform(0.8, reach)
        pose = (x + far * math.cos(angle), y + far * math.sin(angle), float(angle))
        if filling.fits(discs_of("person", pose)):
            return pose
    return filling.anywhere([("person", (0.0, 0.0, 0.0))], "an escort")[0]


def _streams(filling: Filling, n: int) -> None:
    ends = far_ends(filling.scene)
    for k in range(n):
        filling.put([(COAT, f"stream{k}", (0.0, 0.0, 0.0))], "a stream")
        filling.roles[f"stream{k}"] = Role(does="walk", goals=ends, stay=0.0)


def far_ends(scene: Scene) -> tuple[str, ...]:
    """Goals between which streams of people go.

    Those called ``stream...``; where there are none, the two that are the farthest apart.
    """
    named = tuple(name for name in scene.goals if name.startswith("stream"))
    if len(named) > 1:
        return named
    goals = sorted(scene.goals)
    pairs = [(a, b) for i, a in enumerate(goals) for b in goals[i + 1 :]]
    if not pairs:
        return ()
    return max(pairs, key=lambda pair: math.dist(scene.goals[pair[0]], scene.goals[pair[1]]))


def _groups(filling: Filling, n: int) -> None:
    places = ((0.0, 0.0), (0.0, 0.75), (-0.75, 0.1), (-0.75, 0.8))
    for first in range(0, n, GROUP):
        size = min(GROUP, n - first)
        named = [(COAT, f"group{first + k}", (*places[k], 0.0)) for k in range(size)]
        filling.put(named, "a group")
        filling.roles[f"group{first}"] = Role(does="walk", stay=1.0)
        for k in range(1, size):
            name = f"group{first + k}"
            filling.roles[name] = Role(does="follow", leader=f"group{first}", slot=places[k])


def _queue(filling: Filling, n: int) -> None:
    named = [("person", f"queue{k}", (-QUEUE_M * k, 0.0, 0.0)) for k in range(n)]
    filling.put(named, f"a queue of {n}")
    places = tuple(filling.initial[name][:2] for _, name, _ in named)
    for k in range(n):
        filling.roles[f"queue{k}"] = Role(does="queue", places=places, turn=k)


def _pushed(kind: str, name: str) -> Callable[[Filling, int], None]:
    """Things that somebody pushes before them."""

    def put(filling: Filling, n: int) -> None:
        thing = (reach_of(kind) + hull_radius("person") + BESIDE, 0.0, 0.0)
        for k in range(n):
            who, what = f"{name}_pusher{k}", f"{name}{k}"
            filling.put([("person", who, (0.0, 0.0, 0.0)), (kind, what, thing)], f"a {name}")
            filling.holds.append(Hold(holder=who, held=what, pose=thing))
            filling.roles[who] = Role(does="walk", goals=_same_room(filling, who), slow=0.6)

    return put


def _trains(filling: Filling, n: int) -> None:
    gap = 2.0 * reach_of("trolley") + 0.1
    first = (-reach_of("trolley") - hull_radius("person") - BESIDE, 0.0, 0.0)
    for k in range(n):
        who = f"train_puller{k}"
        named = [("person", who, (0.0, 0.0, 0.0))]
        before, at, holds = who, first, list[Hold]()
        for wagon in range(WAGONS):
            name = f"wagon{WAGONS * k + wagon}"
            place = (first[0] - gap * wagon, 0.0, 0.0)
            named.append(("trolley", name, place))
            holds.append(Hold(holder=before, held=name, pose=at, hinged=True))
            before, at = name, (-gap, 0.0, 0.0)
        filling.put(named, "a train")
        filling.holds += holds
        filling.roles[who] = Role(does="walk", goals=_same_room(filling, who), slow=0.75)


def _couches(filling: Filling, n: int) -> None:
    reach = reach_of("couch") + hull_radius("person") + BESIDE
    for k in range(n):
        front, rear, couch = f"carrier{2 * k}", f"carrier{2 * k + 1}", f"couch{k}"
        named = [
            ("person", front, (0.0, 0.0, 0.0)),
            ("couch", couch, (-reach, 0.0, 0.0)),
            ("person", rear, (-2.0 * reach, 0.0, 0.0)),
        ]
        filling.put(named, "a couch")
        filling.holds.append(Hold(holder=front, held=couch, pose=(-reach, 0.0, 0.0), hinged=True))
        filling.holds.append(Hold(holder=rear, held=couch, pose=(reach, 0.0, 0.0), hinged=True))
        filling.roles[front] = Role(does="walk", goals=_same_room(filling, front), slow=0.6)
        filling.roles[rear] = Role(does="follow", leader=front, slot=(-2.0 * reach, 0.0))


def _cleaners(filling: Filling, n: int) -> None:
    for k in range(n):
        row = _row_of_chairs(filling)
        filling.put([("person", f"cleaner{k}", (0.0, 0.0, 0.0))], "a cleaner")
        filling.roles[f"cleaner{k}"] = Role(does="clean", slow=0.8, places=row)


def _row_of_chairs(filling: Filling) -> tuple[tuple[float, float], ...]:
    """Places for a row of chairs at a wall, with room before it to put them there."""
    rooms, radius = list(filling.scene.rooms.values()), hull_radius("chair_swivel")
    for _ in range(10 * TRIES):
        a, b, c, d = rooms[int(filling.rng.integers(len(rooms)))]
        side, along = int(filling.rng.integers(4)), float(filling.rng.uniform(0.0, 1.0))
        half, other = (0.5 * (c - a), 0.5 * (d - b))[:: 1 if side % 2 == 0 else -1]
        wall: Pose = (0.5 * (a + c), 0.5 * (b + d), 0.5 * math.pi * side)
        if half <= 0.5 * ROW * CHAIR_M:
            continue
        first = (2.0 * along - 1.0) * (half - 0.5 * ROW * CHAIR_M) - 0.5 * (ROW - 1) * CHAIR_M
        places = [
            moved(wall, (first + CHAIR_M * k, -other + radius + ROW_WALL, 0.0))[:2]
            for k in range(ROW)
        ]
        before = [
            moved(wall, (first + CHAIR_M * k, -other + 2.0 * radius + ROW_BEFORE, 0.0))[:2]
            for k in range(ROW)
        ]
        discs = [(*p, radius) for p in places] + [(*p, hull_radius("person")) for p in before]
        if filling.fits(discs):
            filling.block(discs)
            return tuple(places)
    raise InvalidValueError(f"crowd: a row of {ROW} chairs does not fit in '{filling.scene.name}'")


_PUT: dict[str, Callable[[Filling, int], None]] = {
    "escorts": _escorts,
    "streams": _streams,
    "groups": _groups,
    "queue": _queue,
    "boards": _pushed("board", "board"),
    "beds": _pushed("hospital_bed", "bed"),
    "trains": _trains,
    "couches": _couches,
    "cleaners": _cleaners,
}


def _same_room(filling: Filling, name: str) -> tuple[str, ...]:
    """Goals of the room that a mover is in, where it has two: what is long keeps out of doors."""
    x, y, _ = filling.initial[name]
    for xmin, ymin, xmax, ymax in filling.scene.rooms.values():
        if xmin <= x <= xmax and ymin <= y <= ymax:
            inside = [
                goal
                for goal, (gx, gy) in filling.scene.goals.items()
                if xmin <= gx <= xmax and ymin <= gy <= ymax
            ]
            if len(inside) > 1:
                return tuple(inside)
    return ()
