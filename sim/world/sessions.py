# SPDX-License-Identifier: Apache-2.0
"""One building over days: sessions at times of the day, between which things are put elsewhere.

Session 0 is the scene as built. From each session to the next, ``round(change * n)`` of its n
movable things and doors stand elsewhere: who is likelier, and where to, is a matter of habits and
of the time of day. A session is a function of scene, seed, ``change`` and its number alone, so it
can be made without those before it. What that simplifies: whatever is pushed about during a session
is put back before the next arrangement, and within a session nothing changes out of sight.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes import build
from scenes.arrangement import MARGIN_M, Places, fits, places_of
from scenes.builder import LATCH
from scenes.scene import Mover, Pose, Scene
from sim.actors.rearranging import ELSEWHERE_M, FAR_M, find_place, is_movable, place_out
from sim.core.dynamism import Dynamism
from sim.core.seeds import STREAMS, Seeds
from sim.core.sight import nobody
from sim.world.times_of_day import (
    AJAR,
    MOST_SESSIONS,
    OPEN,
    SHUT,
    TimeOfDay,
    checked,
    time_of,
)
from slam.frames import Float
from slam.shaped import instance, within

TURNED_RAD = 0.3  # rad, a door turned by less stands as it stood
REMOVED = 0.15  # of the things put elsewhere, taken out of the building
HOME = 0.7  # of those whose hour it is, put back to where they stood in session 0
SETTLED = 0.15  # likelihood of a thing that stands as is its habit, relative to others
ROOM_M = 0.25  # m between the robot's hull and anything where it starts
_OWN = tuple(name for name in STREAMS if name not in ("layout", "change"))


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """Where everything stands at the start of a session.

    poses   of each thing by name; None for one that is out of the building
    angles  of each door by name, rad from shut
    """

    poses: Mapping[str, Pose | None]
    angles: Mapping[str, float]


class Days:
    """The sessions of one building.

    scene   as built: session 0          seeds   whose "change" decides
    change  in [0, 1]: share of things and doors that stand elsewhere from session to session
    """

    def __init__(self, scene: Scene, seeds: Seeds, change: float) -> None:
        self.scene, self.share = scene, within("change", change, 0.0, 1.0)
        self._seed = seeds.integer("change")
        self._places: Places = places_of(scene)
        self._things = [m for m in scene.movers if is_movable(m)]
        self._doors = [m for m in scene.movers if m.kind == "door"]
        first = {m.name: scene.initial[m.name] for m in self._things}
        self._made = [Arrangement(poses=first, angles=dict(scene.door_angles))]

    @property
    def n(self) -> int:
        """How many things and doors there are."""
        return len(self._things) + len(self._doors)

    def arrangement(self, session: int) -> Arrangement:
        """Of that session; ``InvalidValueError`` for a number that is none."""
        checked(session)
        while len(self._made) <= session:
            self._made.append(self._next(len(self._made)))
        return self._made[session]

    def draws(self, session: int) -> np.random.Generator:
        """What is drawn for one session."""
        sequence = np.random.SeedSequence(entropy=self._seed, spawn_key=(session,))
        return np.random.Generator(np.random.PCG64(sequence))

    def _next(self, session: int) -> Arrangement:
        before, rng, time = self._made[session - 1], self.draws(session), time_of(session)
        poses, angles = dict(before.poses), dict(before.angles)
        order = sorted((self._key(m, rng, poses, angles, time), m.name) for m in self._all())
        movers = {m.name: m for m in self._all()}
        wanted = math.floor(self.share * self.n + 0.5)
        start = float(rng.random())
        for _, name in order:
            if wanted == 0:
                break
            mover = movers[name]
            luck = np.array([rng.integers(0, 1 << 63)], dtype=np.uint64)
            if mover.kind == "door":
                angles[name] = _turned(angles[name], float(rng.random()), time)
                wanted -= 1
            else:
                wanted -= int(self._put(mover, poses, rng, (luck, start), time))
        return Arrangement(poses=poses, angles=angles)

    def _all(self) -> list[Mover]:
        return [*self._things, *self._doors]

    def _key(
        self,
        mover: Mover,
        rng: np.random.Generator,
        poses: Mapping[str, Pose | None],
        angles: Mapping[str, float],
        time: TimeOfDay,
    ) -> float:
        """The less, the sooner it is put elsewhere: an exponential waiting time."""
        likely = time.likely.get(mover.group, 1.0) * self._restless(mover)
        if mover.kind == "door":
            low, high = time.doors
            settled = low - 0.05 <= angles[mover.name] <= high + 0.05
        else:
            settled = time.home and poses[mover.name] == self.scene.initial[mover.name]
        likely *= SETTLED if settled else 1.0
        return -math.log(1.0 - float(rng.random())) / likely

    def _restless(self, mover: Mover) -> float:
        """A thing's own habit, 0.4 to 1.6, the same in all sessions: some wander, some hardly."""
        number = [m.name for m in self.scene.movers].index(mover.name)
        sequence = np.random.SeedSequence(entropy=self._seed, spawn_key=(MOST_SESSIONS, number))
        return 0.4 + 1.2 * float(sequence.generate_state(1)[0]) / 2.0**32

    def _put(
        self,
        mover: Mover,
        poses: dict[str, Pose | None],
        rng: np.random.Generator,
        draws: tuple[NDArray[np.uint64], float],
        time: TimeOfDay,
    ) -> bool:
        """Put one thing elsewhere, out of the building if need be; False where it stays out."""
        here, home = poses[mover.name], self.scene.initial[mover.name]
        leave, stay = float(rng.random()) < REMOVED, float(rng.random())
        if here is not None and leave:
            poses[mover.name] = None
            return True
        discs = self._discs(poses)
        own = self._things.index(mover)
        x, y, _ = (FAR_M, FAR_M, 0.0) if here is None else here
        far = math.hypot(x - home[0], y - home[1]) >= ELSEWHERE_M
        boxes = np.ascontiguousarray(self._places.boxes)
        back = time.home and stay < HOME and far
        if back and fits(home[0], home[1], mover.radius - MARGIN_M, own, discs, boxes):
            poses[mover.name] = home
            return True
        places, thing = self._places.of(mover), (own, x, y, mover.radius)
        _, at = find_place(draws[0], draws[1], thing, places, time.sorts, (discs, boxes), nobody())
        if at >= 0:
            px, py, yaw = places.poses[at].tolist()
            poses[mover.name] = (px, py, yaw)
            return True
        poses[mover.name] = None
        return here is not None

    def _discs(self, poses: Mapping[str, Pose | None]) -> Float:
        """(n, 3) x, y, radius m of the things, those that are out far away."""
        rows = []
        for mover in self._things:
            x, y, _ = poses[mover.name] or (FAR_M, FAR_M, 0.0)
            rows.append((x, y, mover.radius))
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def start(self, session: int) -> Pose:
        """Where the robot starts: anywhere on free floor; session 0 starts as the scene does."""
        arrangement, rng = self.arrangement(session), self.draws(MOST_SESSIONS + session)
        if session == 0:
            return self.scene.start
        robot = self.scene.movers[-1]
        spot = self._floor(self._discs(arrangement.poses), robot.radius + ROOM_M, rng)
        heading = float(rng.uniform(-math.pi, math.pi))
        return self.scene.start if spot is None else (*spot, heading)

    def _floor(
        self, discs: Float, radius: float, rng: np.random.Generator
    ) -> tuple[float, float] | None:
        """Free floor anywhere in the rooms for a disc."""
        rooms = list(self.scene.rooms.values())
        areas = np.cumsum([(r[2] - r[0]) * (r[3] - r[1]) for r in rooms])
        boxes = np.ascontiguousarray(self._places.boxes)
        for _ in range(2000):
            which, u, v = rng.random(3).tolist()
            k = int(np.searchsorted(areas, which * areas[-1], side="right"))
            x0, y0, x1, y1 = rooms[k]
            x, y = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
            inside = min(x - x0, x1 - x, y - y0, y1 - y) >= radius
            if inside and fits(x, y, radius, -1, discs, boxes):
                return x, y
        return None

    def arranged(self, scene: Scene, session: int) -> Scene:
        """``scene``, the same building with these or fewer people, as it is in that session."""
        arrangement, start = self.arrangement(session), self.start(session)
        initial, rng = dict(scene.initial), self.draws(2 * MOST_SESSIONS + session)
        for row, mover in enumerate(self.scene.movers):
            if mover.name in arrangement.poses:
                pose = arrangement.poses[mover.name]
                initial[mover.name] = pose or place_out(row, scene.bounds)
        initial["robot"] = start
        self._make_room(scene, initial, arrangement, rng)
        spec = scene.spec.copy()
        for name, angle in arrangement.angles.items():
            spec.joint(f"{name}/hinge").springref = angle if angle > 0.0 else LATCH
        return replace(
            scene,
            spec=spec,
            initial=initial,
            door_angles=dict(arrangement.angles),
            start=start,
            options={**scene.options, "session": session},
        )

    def _make_room(
        self,
        scene: Scene,
        initial: dict[str, Pose],
        arrangement: Arrangement,
        rng: np.random.Generator,
    ) -> None:
        """Let people who would stand in a thing, a leaf or the robot stand elsewhere."""
        boxes = np.ascontiguousarray(self._places.boxes)
        discs = self._discs(arrangement.poses)
        start = (*initial["robot"][:2], scene.movers[-1].radius + ROOM_M)
        discs = np.vstack([discs, [start]])
        for mover in scene.movers:
            if mover.group != "person":
                continue
            x, y, yaw = initial[mover.name]
            if not fits(x, y, mover.radius, -1, discs, boxes):
                spot = self._floor(discs, mover.radius, rng)
                initial[mover.name] = (*spot, yaw) if spot else (x, y, yaw)
            discs = np.vstack([discs, [(*initial[mover.name][:2], mover.radius)]])


def _turned(angle: float, luck: float, time: TimeOfDay) -> float:
    """Another angle of rest for a door: what is usual then, else another."""
    for low, high in (time.doors, OPEN, SHUT, AJAR):
        wanted = round(low + luck * (high - low), 3)
        if abs(wanted - angle) >= TURNED_RAD:
            return wanted
    return 0.0  # unreachable: open and shut are further apart


def seeds_of(seeds: Seeds, session: int) -> Seeds:
    """The seeds of one session: the building's, and streams of its own for all that happens."""
    if session == 0:
        return seeds
    own = {}
    for name in _OWN:
        sequence = np.random.SeedSequence(entropy=seeds.integer(name), spawn_key=(session,))
        own[name] = int(sequence.generate_state(1)[0] >> 1)
    kept = {k: v for k, v in seeds.record().items() if k != "seed"}
    return Seeds(seeds.seed, **{**kept, **own})


def slowed(rates: Dynamism, factor: float) -> Dynamism:
    """Rates times a factor in [0, 1]."""
    if factor == 1.0:
        return rates
    names = ("chair_push_rate", "bin_kick_rate", "load_push_rate", "door_rate")
    slower = {name: factor * getattr(rates, name) for name in names}
    share = None if rates.moving_share is None else factor * rates.moving_share
    stay = math.inf if factor == 0.0 else rates.stay_mean / factor
    crowd = factor * rates.crowd
    return replace(rates, moving_share=share, stay_mean=stay, crowd=crowd, **slower)


def opened(
    scene: Scene | str, seeds: Seeds, change: float, session: int, options: Mapping[str, Any]
) -> tuple[Scene, Seeds]:
    """The scene and the seeds of one session.

    scene  a name is built with fewer people where fewer are about; a built one keeps its own
    """
    time = time_of(checked(session))
    if not isinstance(scene, str):
        instance("scene", scene, Scene)
        own = replace(scene, spec=scene.spec.copy())  # a crowd may be put into it
        return Days(own, seeds, change).arranged(own, session), seeds_of(seeds, session)
    whole = build(scene, seed=seeds.integer("layout"), **options)
    days, people = Days(whole, seeds, change), _people(whole)
    present = math.floor(time.present * people + 0.5)
    if present < people and "n_people" in whole.options:
        fewer = {**options, "n_people": present}
        whole = build(scene, seed=seeds.integer("layout"), **fewer)
    return days.arranged(whole, session), seeds_of(seeds, session)


def _people(scene: Scene) -> int:
    names: Sequence[str] = [m.name for m in scene.movers if m.group == "person"]
    return len(names)
