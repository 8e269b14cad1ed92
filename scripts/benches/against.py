# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench --against``: the same work by others, in turn with ours.

A ratio of processor times outlives the machine and what else runs on it, where a time does not:
ours and a peer's take turns in blocks, and each pair of blocks gives one ratio.
"""

import importlib
import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from scripts import marks, workers
from scripts.benches.world import DYNAMISM, SEED, many, scan, timed
from sim.gym.vector import MobiliaVectorEnv
from sim.recording.episode import record
from sim.recording.recipe import Recipe
from sim.sensors.lidar.candidates import UNSEEN_GROUPS
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import stream
from sim.world.world import World
from slam._jit import njit
from slam.errors import MissingDependencyError
from slam.frames import Frame, LaserSpec
from slam.system import SlamSystem, create

PAIRS = 15
LOW, HIGH = 3, 11  # of the sorted ratios: the median lies between these, 96 %, whatever their law
PEERS = ("kiss-icp", "small-gicp", "karto")
MOST_COPIES = 8
LOOP = 50_000_000
EPISODE = Recipe(scene="office", seed=SEED, dynamism=DYNAMISM, seconds=2.0)
Row = dict[str, Any]
Pairs = tuple[list[float], list[float]]  # of ours, of a peer


def compared(what: str, found: Pairs, scale: float, unit: str, how: str) -> Row:
    """One line: medians of both times ``scale``, and the ratio peer / ours with its interval."""
    ours, peers = np.array(found) * scale
    ratios = np.sort(peers / ours)
    return {
        "what": what, "ours": float(np.median(ours)), "peer": float(np.median(peers)), "unit": unit,
        "ratio": float(np.median(ratios)), "low": float(ratios[LOW]), "high": float(ratios[HIGH]),
        "how": how,
    }  # fmt: skip


def in_turn(
    ours: Callable[..., object], peer: Callable[..., object], clock: Callable[..., float] = timed
) -> Pairs:
    """``PAIRS`` times of each, after one of each that does not count."""
    pairs = [(clock(ours), clock(peer)) for _ in range(PAIRS + 1)][1:]
    return [a for a, _ in pairs], [b for _, b in pairs]


def scans(seconds: float) -> Iterator[Row]:
    """A scan, with the time, label and truth of each beam, against MuJoCo's bare rays."""
    count = max(10, round(2 * seconds))
    crowded: dict[str, Any] = {"n_chairs": 200}
    for name, options in (("office", {}), ("office, 200 chairs", crowded)):
        world, laser = at_rest("office", **options)
        found = in_turn(many(count, scan, laser, world), bare_rays(world, laser, count))
        how = "361 ideal beams; the peer has one origin, no times, no labels"
        yield compared(f"scan, {name}: `mj_multiRay`", found, 1e6 / count, "µs", how)


def at_rest(scene: str, **options: Any) -> tuple[World, LaserScanner]:
    """A world and an ideal scanner in it."""
    world = World(scene, seed=SEED, dynamism=DYNAMISM, **options)
    return world, LaserScanner(world.model, Lms221Config.ideal(), np.random.default_rng(0))


def others(seconds: float) -> Iterator[Row]:
    """A scan of the arena against one by ir-sim among the same boxes, and movers as discs."""
    count = max(10, round(2 * seconds))
    try:
        irsim = importlib.import_module("irsim")
    except ImportError:
        return
    world, laser = at_rest("arena")
    peer = ir_sim(irsim, world, laser.spec).robot_list[0]
    state = np.array([world.robot_pose()]).T
    found = in_turn(many(count, scan, laser, world), many(count, peer.lidar.step, state))
    how = "361 ideal beams among the same boxes and discs; the peer has no times, no labels"
    yield compared("scan, arena: ir-sim", found, 1e6 / count, "µs", how)


def ir_sim(irsim: Any, world: World, spec: LaserSpec) -> Any:
    """The walls and furniture of a room as boxes in ir-sim, everything that moves as a disc."""
    x, y, far_x, far_y = world.scene.bounds
    *movers, _ = zip(world.mover_poses().tolist(), world.scene.movers, strict=True)
    discs = [(pose, {"name": "circle", "radius": float(m.radius)}) for pose, m in movers]
    boxes = [
        ([x, y, yaw], {"name": "rectangle", "length": 2.0 * a, "width": 2.0 * b})
        for x, y, a, b, yaw in world.scene.obstacles.tolist()
    ]
    sees = {"name": "lidar2d", "number": spec.n_beams, "range_max": spec.range_max,
            "angle_range": math.pi, "offset": spec.T_robot_laser.tolist()}  # fmt: skip
    robot = {"kinematics": {"name": "diff"}, "shape": {"name": "circle", "radius": 0.2},
             "state": world.robot_pose().tolist(), "sensors": [sees]}  # fmt: skip
    told = {
        "world": {"width": far_x - x, "height": far_y - y, "offset": [x, y]}, "robot": [robot],
        "obstacle": [{"state": state, "shape": shape} for state, shape in boxes + discs],
    }  # fmt: skip
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        json.dump(told, file)  # which is YAML
        file.flush()
        return irsim.make(file.name, display=False, log_level="ERROR")


def bare_rays(world: World, laser: LaserScanner, count: int) -> Callable[[], None]:
    """Work: the same rays by MuJoCo, from where the laser is."""
    model, data, n = world.model, world.data, laser.spec.n_beams
    groups = np.array([g not in UNSEEN_GROUPS for g in range(6)], dtype=np.uint8)
    at = data.site("robot/laser")
    local = [(np.cos(a), np.sin(a), 0.0) for a in laser.spec.angles.tolist()]
    rays = np.ascontiguousarray(np.array(local) @ at.xmat.reshape(3, 3).T).ravel()
    geoms, ranges = np.empty(n, dtype=np.int32), np.empty(n)
    own = model.body("robot/base").id
    return many(
        count, mujoco.mj_multiRay,
        model, data, at.xpos, rays, groups, True, own, geoms, ranges, None, n, 80.0,
    )  # fmt: skip


def slams(seconds: float) -> Iterator[Row]:
    """Updates of ``shunting`` against those of SLAMs from outside, on the same scans."""
    blind = [f.without_truth() for f in stream("office", seed=SEED, dynamism=DYNAMISM,
                                               seconds=seconds + 2.0)]  # fmt: skip
    part = len(blind) // (PAIRS + 1)
    for name in PEERS:
        try:
            systems = [create("shunting"), create(name)]
        except MissingDependencyError:
            continue
        ours, peer = (updating(system, iter(blind), part) for system in systems)
        found = in_turn(ours, peer)
        how = f"mean of {part} scans of the office, every effect, 361 beams, all threads"
        yield compared(f"SLAM: {name}", found, 1e3 / part, "ms", how)


def updating(system: SlamSystem, frames: Iterator[Frame], count: int) -> Callable[[], None]:
    """Work: the next so many scans."""
    return many(count, lambda: system.update(next(frames)))


def rooms(seconds: float) -> Iterator[Row]:
    """Steps of a vector environment: what its workers get done more than one process.

    The plain loop runs in the very same processes: some systems share out the processor by session.
    """
    steps, still = max(10, round(4 * seconds)), np.zeros((MOST_COPIES, 2), np.float32)
    for copies in several():
        sides = {
            n: MobiliaVectorEnv(
                MOST_COPIES, n_workers=n - (n == 1), scene="arena", time_limit_s=1e6
            )
            for n in (1, copies)
        }
        for side in sides.values():
            side.reset(seed=SEED)

        def stepped(n: int, sides: dict[int, MobiliaVectorEnv] = sides) -> float:
            return wall(many(n * steps, sides[n].step, still))

        def looped(n: int, sides: dict[int, MobiliaVectorEnv] = sides) -> float:
            firsts = [k * MOST_COPIES // n for k in range(n)]
            return wall(lambda: sides[n].each(one_loop, firsts))

        yield gain(f"{MOST_COPIES} rooms, {copies} workers", copies, stepped, looped)
        for side in sides.values():
            side.close()


def episodes(_: float) -> Iterator[Row]:
    """Episodes that are made: what so many processes get done more than one."""
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(MOST_COPIES) as loops:

        def made(copies: int) -> float:
            out = Path(tempfile.mkdtemp(dir=scratch))
            jobs = [replace(EPISODE, seed=SEED + k) for k in range(copies)]
            return wall(lambda: list(workers.each(partial(record, parent=out), jobs, jobs=copies)))

        def looped(n: int) -> float:
            return wall(lambda: list(loops.map(one_loop, range(n))))

        for copies in several():
            yield gain(f"episodes, {copies} processes", copies, made, looped)


def several() -> list[int]:
    """Two copies, and one a core where there are more."""
    return sorted({2, min(os.cpu_count() or 2, MOST_COPIES)} - {1})


def gain(
    what: str, copies: int, work: Callable[[int], float], looped: Callable[[int], float]
) -> Row:
    """What so many get done more than one, by the wall, beside as many copies of a plain loop."""
    how = f"times what one does, by {copies}; what else runs on the machine counts"
    found = in_turn(work, looped, lambda each: copies * each(1) / each(copies))
    return compared(f"{what}: {copies} copies of a plain loop", found, 1.0, "×", how)


def wall(work: Callable[[], object]) -> float:
    """s."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def one_loop(_: object) -> float:
    """The plain loop, for who calls it with something."""
    return float(loop(LOOP))


@njit
def loop(times: int) -> float:
    """Additions one after the other, without the interpreter's lock."""
    total = 0.0
    for k in range(times):
        total = 0.5 * total + k
    return total


def _digits(figure: float) -> str:
    return f"{figure:.0f}" if figure >= 100.0 else f"{figure:.2g}"


def table(found: list[Row], machine: dict[str, Any], only: str) -> str:
    """As a table of Markdown, with the machine and how busy it is."""
    rows = [
        [row["what"], row["unit"], _digits(row["ours"]), _digits(row["peer"]),
         f"{_digits(row['ratio'])} ({_digits(row['low'])}–{_digits(row['high'])})"]
        for row in found
    ]  # fmt: skip
    heads = ("against", "unit", "mobilia", "peer", "peer / mobilia (96 %)")
    where = f"{machine['processor']} with {machine['cores']} cores at load {os.getloadavg()[0]:.0f}"
    said = f"--only {only} " if only else ""
    made = f"Made by `mobilia bench --against {said}--page` on an {where}."
    return f"{marks.table(heads, rows, left=2)}\n\n{made}"
