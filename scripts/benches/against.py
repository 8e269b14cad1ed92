# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench --against``: the same work by others, in turn with ours.

A ratio of processor times outlives the machine and what else runs on it, where a time does not:
ours and a peer's take turns in blocks, and each pair of blocks gives one ratio.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import mujoco
import numpy as np

from scripts import marks, workers
from scripts.benches.world import DYNAMISM, SEED, note_poses, timed
from sim.sensors.lidar.candidates import UNSEEN_GROUPS
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation, n_frames, stream, tour
from sim.world.world import World
from slam.errors import MissingDependencyError
from slam.system import create

PAIRS = 15
LOW, HIGH = 3, 11  # of the sorted ratios: the median lies between these, 96 %, whatever their law
PEERS = ("kiss-icp", "small-gicp", "karto")
COPIES = 2
LOOP = 5_000_000
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


def rows(seconds: float) -> Iterator[Row]:
    """Scan, SLAM and processes; a peer that is not installed is left out."""
    yield from scans(max(10, round(2 * seconds)))
    yield from slams(seconds)
    yield processes(seconds)


def scans(count: int) -> Iterator[Row]:
    """A scan, with the time, label and truth of each beam, against MuJoCo's bare rays."""
    crowded: dict[str, Any] = {"n_chairs": 200}
    for name, options in (("office", {}), ("office, 200 chairs", crowded)):
        world = World("office", seed=SEED, dynamism=DYNAMISM, **options)
        laser = LaserScanner(world.model, Lms221Config.ideal(), np.random.default_rng(0))

        def ours(laser: LaserScanner = laser, world: World = world) -> None:
            for _ in range(count):
                note_poses(laser.begin(world.data), int(laser.window.marks[1:].sum()))
                laser.finish()

        found = in_turn(ours, partial(bare_rays, world, laser, count))
        how = "361 ideal beams; the peer has one origin, no times, no labels"
        yield compared(f"scan, {name}: `mj_multiRay`", found, 1e6 / count, "µs", how)


def bare_rays(world: World, laser: LaserScanner, count: int) -> None:
    """The same rays by MuJoCo, from where the laser is."""
    model, data, n = world.model, world.data, laser.spec.n_beams
    groups = np.array([g not in UNSEEN_GROUPS for g in range(6)], dtype=np.uint8)
    at = data.site("robot/laser")
    local = [(np.cos(a), np.sin(a), 0.0) for a in laser.spec.angles.tolist()]
    rays = np.ascontiguousarray(np.array(local) @ at.xmat.reshape(3, 3).T).ravel()
    geoms, ranges = np.empty(n, dtype=np.int32), np.empty(n)
    own = model.body("robot/base").id
    for _ in range(count):
        mujoco.mj_multiRay(
            model, data, at.xpos, rays, groups, True, own, geoms, ranges, None, n, 80.0
        )


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
        ahead = [iter(blind), iter(blind)]

        def some(k: int, systems: list[Any] = systems, ahead: list[Any] = ahead) -> None:
            for _ in range(part):
                systems[k].update(next(ahead[k]))

        found = in_turn(partial(some, 0), partial(some, 1))
        how = f"mean of {part} scans of the office, every effect, 361 beams, all threads"
        yield compared(f"SLAM: {name}", found, 1e3 / part, "ms", how)


def processes(seconds: float) -> Row:
    """What two processes get done more than one, by the wall: simulation, and a plain loop."""
    simulated = max(seconds / PAIRS, 2.0)

    def gain(work: Callable[[int], object]) -> float:
        return COPIES * _wall(work, 1) / _wall(work, COPIES)

    found = in_turn(partial(_drive, simulated), _loop, gain)
    how = f"times the work of one by {COPIES} processes; what else runs on the machine counts"
    return compared("two processes: a plain loop", found, 1.0, "×", how)


def _wall(work: Any, copies: int) -> float:
    start = time.perf_counter()
    for _ in workers.each(work, list(range(copies)), jobs=copies):
        pass
    return time.perf_counter() - start


def _drive(seconds: float, seed: int) -> None:
    room = Simulation("office", seed=SEED + seed, dynamism=DYNAMISM)
    frames = tour(room, seconds)
    for _ in range(n_frames(seconds, room.scan_period_s)):
        next(frames)


def _loop(_: int) -> int:
    total = 0
    for k in range(LOOP):
        total += k & 7
    return total


def _digits(figure: float) -> str:
    return f"{figure:.0f}" if figure >= 100.0 else f"{figure:.2g}"


def table(found: list[Row], machine: dict[str, Any]) -> str:
    """As a table of Markdown, with the machine and how busy it is."""
    rows = [
        [row["what"], row["unit"], _digits(row["ours"]), _digits(row["peer"]),
         f"{_digits(row['ratio'])} ({_digits(row['low'])}–{_digits(row['high'])})"]
        for row in found
    ]  # fmt: skip
    heads = ("against", "unit", "mobilia", "peer", "peer / mobilia (96 %)")
    where = f"{machine['processor']} with {machine['cores']} cores at load {os.getloadavg()[0]:.0f}"
    made = f"Made by `mobilia bench --against --page` on an {where}."
    return f"{marks.table(heads, rows, left=2)}\n\n{made}"
