# SPDX-License-Identifier: Apache-2.0
"""Does anybody walk through anything, and does a world last? Tours of a robot.

``python -m scripts.experiments.penetration``; ``--seconds 7200`` for a world of two hours. How deep
hulls were in each other at most, once a scan, and how hard the robot was touched. A force is the
greatest of all substeps, each of which lasts 1/300 s: 300 N change the speed of a robot of 22 kg by
0.05 m/s. A hull is a sphere around what is drawn, so two that overlap by a few centimetres do not
yet show it. Beside these, what must not happen in a long run: warnings of the physics, movers off
the floor or inside a wall, numbers that are not finite, memory that grows.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import scenes
from scripts.comparison.memory import reading_kb
from scripts.experiments.shared import Column, Row, of
from scripts.experiments.study import Study
from sim.actors.rearranging import is_out
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, n_frames
from slam.frames import NS_PER_S, Float

Pair = tuple[str, str]
EVERY = 75  # scans between looks at all of the world


class Depths:
    """The greatest depth so far, of each pair of kinds, m: ``worst[pair]`` with time s and names.

    What does not move is the kind "static". Feet and floor, which always touch, are left out.
    """

    def __init__(self, simulation: Simulation) -> None:
        world = simulation.world
        self._world, self.worst = world, dict[Pair, tuple[float, float, str, str]]()
        self._owner = world.bodies.mover_of_body[world.model.geom_bodyid]
        self._names = [*(mover.name for mover in world.scene.movers), "static"]
        kinds = [*(mover.kind for mover in world.scene.movers), "static"]
        known = sorted(set(kinds))
        self._known, self._kind = known, np.array([known.index(kind) for kind in kinds])
        self._deepest = np.zeros((len(known), len(known)))

    def look(self) -> None:
        """Take in the contacts as they are now."""
        contact = self._world.data.contact
        owners = self._owner[contact.geom].reshape(-1, 2)
        kinds = np.sort(self._kind[owners], axis=1)
        depth: NDArray[np.float64] = -contact.dist
        for k in np.flatnonzero(depth > self._deepest[kinds[:, 0], kinds[:, 1]]).tolist():
            a, b = kinds[k].tolist()
            if depth[k] > self._deepest[a, b] and owners[k, 0] != owners[k, 1]:
                self._deepest[a, b] = depth[k]
                one, two = (self._names[owner] for owner in owners[k].tolist())
                found = float(depth[k]), self._world.time_ns / NS_PER_S, one, two
                self.worst[self._known[a], self._known[b]] = found


def run(case: Row) -> Row:
    """A tour: the deepest of all pairs of kinds, the hardest touch, and what went wrong."""
    options = {"crowd": case["crowd"]} if case["crowd"] else {}
    simulation = Simulation(
        case["scene"], seed=case["seed"], dynamism=0.0, motion=case["motion"], **options
    )
    world, pilot, depths = simulation.world, Pilot(simulation.world), Depths(simulation)
    touch, escaped, infinite, memory_mb = (0.0, 0.0, "nobody"), set[str](), 0, list[float]()
    for k in range(n_frames(case["seconds"], simulation.scan_period_s)):
        world.set_command(*pilot.command(simulation.scan_period_s))
        simulation.sense()
        depths.look()
        for one in simulation.contacts:
            touch = max(touch, (one.force, world.time_ns / NS_PER_S, one.name))
        if k % EVERY == 0:
            escaped |= set(_escaped(simulation))
            infinite += int(not np.isfinite(world.data.qpos).all())
            memory_mb.append(reading_kb("VmRSS") * 1024.0 / 1e6)
    depth, at_s, *who = max(depths.worst.values(), default=(0.0, 0.0, "nothing", "nothing"))
    return {
        "depth_m": depth, "deepest": f"{' and '.join(who)} at {at_s:.1f} s", "force_n": touch[0],
        "touch": f"{touch[2]} at {touch[1]:.1f} s", "escaped": sorted(escaped),
        "wrong": infinite + sum(warning.number for warning in world.data.warning),
        "grown_mb": memory_mb[-1] - memory_mb[len(memory_mb) // 10], "goals": pilot.driver.visited,
    }  # fmt: skip


def _escaped(simulation: Simulation) -> list[str]:
    """Movers whose centre is off the floor or in a wall, a hull's radius too deep."""
    scene = simulation.world.scene
    moved = zip(scene.movers, simulation.world.mover_poses(), strict=True)
    return [
        mover.name
        for mover, pose in moved
        if mover.group != "door" and not is_out(pose, scene.bounds) and _off(simulation, pose)
    ]


def _off(simulation: Simulation, pose: Float) -> bool:
    scene, (x, y) = simulation.world.scene, pose[:2].tolist()
    xmin, ymin, xmax, ymax = scene.bounds
    if not (xmin < x < xmax and ymin < y < ymax):
        return True
    raster = scene.static_map
    column = int((x - float(raster.T_map_origin[0])) / raster.resolution_m)
    row = int((y - float(raster.T_map_origin[1])) / raster.resolution_m)
    rows, columns = raster.values.shape
    return 0 <= row < rows and 0 <= column < columns and bool(raster.values[row, column] > 0.5)


def most(number: str, words: str, unit: str, scale: float = 1.0) -> Column:
    """A column: the greatest of the runs, and who it was."""

    def tell(rows: Sequence[Row]) -> str:
        worst = max(rows, key=lambda row: float(row[number]))
        return f"{scale * worst[number]:.0f} {unit}, {worst[words]} (seed {worst['seed']})"

    return tell


STUDY = Study(
    name="penetration",
    axes={"scene": tuple(scenes.names()), "motion": (1.0,), "crowd": ("",)},
    run=run, lines=("scene",),
    columns={
        "deepest": most("depth_m", "deepest", "mm", 1e3),
        "hardest touch": most("force_n", "touch", "N"),
        "escaped": lambda rows: str(sum(len(row["escaped"]) for row in rows)),
        "warnings": of("wrong", np.sum, form="{:.0f}"),
        "memory, MB": of("grown_mb", np.max, form="{:+.1f}"),
    },
    defaults={"seeds": 1, "first_seed": 0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
