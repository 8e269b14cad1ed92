# SPDX-License-Identifier: Apache-2.0
"""Does anybody walk through anything? ``python -m scripts.experiments.penetration``.

For each scene, at motion 1: how deep hulls were in each other at most, for each pair of kinds, and
how hard the robot was touched. Depths are looked at once a scan. A force is the greatest of all
substeps, each of which lasts 1/300 s: 300 N change the speed of a robot of 22 kg by 0.05 m/s. A
hull is a sphere around what is drawn, so two that overlap by a few centimetres do not yet show
it. Of each pair the deepest moment is printed with its time, to be looked at.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import scenes
from sim.driving.pilot import Pilot
from sim.simulation import Simulation, n_frames
from slam.frames import NS_PER_S

Pair = tuple[str, str]
Worst = tuple[float, float, str]  # N, s, whom
MOST_M = 0.10  # deeper, something has gone through something


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


def measure(
    scene: str, seed: int, motion: float, seconds: float, crowd: str | None = None
) -> tuple[Depths, dict[str, Worst]]:
    """A tour: the depths, and of each kind the hardest touch of the robot."""
    options: dict[str, Any] = {} if crowd is None else {"crowd": crowd}
    simulation = Simulation(scene, seed=seed, dynamism=0.0, motion=motion, **options)
    pilot, depths, forces = Pilot(simulation.world), Depths(simulation), dict[str, Worst]()
    for _ in range(n_frames(seconds, simulation.scan_period_s)):
        simulation.world.set_command(*pilot.command(simulation.scan_period_s))
        simulation.sense()
        depths.look()
        for touch in simulation.contacts:
            found = touch.force, simulation.world.time_ns / NS_PER_S, touch.name
            forces[touch.kind] = max(forces.get(touch.kind, found), found)
    return depths, forces


def _report(scene: str, seed: int, depths: Depths, forces: dict[str, Worst]) -> bool:
    """Print a scene's lines; whether something was too deep."""
    worst = sorted(depths.worst.items(), key=lambda item: -item[1][0])
    for (a, b), (depth, at_s, one, two) in worst:
        where = f"{one} and {two} at {at_s:.2f} s"
        print(f"| {scene} | {seed} | {a}, {b} | {1000.0 * depth:.1f} | {where} |")
    peaks = ", ".join(
        f"{name} with {force:.0f} N at {at_s:.2f} s" for force, at_s, name in forces.values()
    )
    print(f"{scene}, seed {seed}: the robot was touched by {peaks or 'nothing'}", flush=True)
    return any(depth > MOST_M for _, (depth, *_) in worst)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; 1 where something was deeper than ``MOST_M``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=scenes.names())
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--motion", type=float, default=1.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--crowd", help="like escorts:6,boards:2; default: that of the scene")
    wanted = parser.parse_args(arguments)
    print("| scene | seed | kinds | deepest, mm | who, when |\n|---|---:|---|---:|---|")
    bad = False
    for scene in wanted.scenes:
        for seed in wanted.seeds:
            found = measure(scene, seed, wanted.motion, wanted.seconds, wanted.crowd)
            bad |= _report(scene, seed, *found)
    return int(bad)


if __name__ == "__main__":
    raise SystemExit(main())
