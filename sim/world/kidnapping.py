# SPDX-License-Identifier: Apache-2.0
"""The kidnapped robot: now and then it is carried elsewhere, and its odometry does not know.

It is put to where it stood earlier on its tour, at the same heading, so what it sees there has been
mapped. It stands still at first, and its wheels have not rolled on the way.
"""

from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from scenes.assembly import discs_of
from sim.core.seeds import Seeds
from sim.world.world import World
from slam.frames import NS_PER_S, Float
from slam.shaped import MOST, shaped

FAR_M = 3.0  # m from where it is taken to where it is put, at least
FREE_M = 0.35  # m between its hull and that of anything that moves, where it is put
LEAST_S = 1.0  # s from one time to the next, at least
_NOTED_NS = NS_PER_S // 2  # between two places that are kept in mind


class Kidnapping:
    """Who carries one robot away.

    every_s  s from one time to the next, the first after so long; where no earlier place is far and
             free, it is put off to the next scan
    seeds    of the run: the "driving" stream decides, which the tour does not notice. It ranks the
             places without regard to what moves, and the first one that is far and free is taken:
             without a mover that is the same one, unless the mover was in its way
    """

    def __init__(self, every_s: float, seeds: Seeds) -> None:
        shaped("kidnap_every_s", every_s, Annotated[float, Meta(ge=LEAST_S, le=MOST)])
        self._every_ns, self._seed = round(every_s * NS_PER_S), seeds.integer("driving")
        self._noted_ns, self._done = 0, 0
        self._visited: list[Float] = []

    def carried(self, world: World) -> bool:
        """Call it before each scan: whether the robot was put elsewhere just now."""
        now_ns = world.time_ns
        if now_ns >= self._noted_ns:
            self._visited.append(world.robot_pose())
            self._noted_ns = now_ns + _NOTED_NS
        turn = now_ns // self._every_ns
        if turn <= self._done:
            return False
        places = self._free(world, turn)
        if not len(places):
            return False
        self._done = turn
        world.carry(places[0])
        return True

    def _free(self, world: World, turn: int) -> Float:
        """(k, 3) earlier poses that are far from the robot and free of everything that moves.

        In an order that is the same whoever moves there, and however many are visited later.
        """
        ranks = np.random.default_rng([self._seed, turn]).random(len(self._visited))
        places = np.array(self._visited)[np.argsort(ranks, kind="stable")]
        robot, discs = world.bodies.robot, hull_discs(world)
        assert robot is not None
        apart = places[:, None, :2] - discs[None, :, :2]
        gaps = np.sqrt((apart * apart).sum(axis=2)) - discs[:, 2]
        away = places[:, :2] - world.robot_pose()[:2]
        far = np.sqrt((away * away).sum(axis=1)) >= FAR_M
        free: Float = places[far & (gaps > world.bodies.radius[robot] + FREE_M).all(axis=1)]
        return free

    def save(self) -> tuple[dict[str, NDArray[Any]], dict[str, int]]:
        """Arrays and words from which ``load`` goes on."""
        visited = np.array(self._visited).reshape(-1, 3)
        return {"kidnap.visited": visited}, {"noted_ns": self._noted_ns, "done": self._done}

    def load(self, arrays: dict[str, NDArray[Any]], words: dict[str, int]) -> None:
        """Inverse of ``save``."""
        self._visited = list(arrays["kidnap.visited"].reshape(-1, 3))
        self._noted_ns, self._done = int(words["noted_ns"]), int(words["done"])


def hull_discs(world: World, *, doors: bool = True) -> Float:
    """(k, 3) x, y, radius m of all hulls of what moves but the robot; of a door, all its swing."""
    rows: list[tuple[float, ...]] = []
    for mover, pose in zip(world.scene.movers, world.mover_poses().tolist(), strict=True):
        if mover.group == "door":
            rows += [(*pose[:2], mover.radius)] if doors else []
        elif mover.group != "robot":
            rows += discs_of(mover.kind, pose)
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
