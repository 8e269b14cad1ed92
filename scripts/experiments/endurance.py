# SPDX-License-Identifier: Apache-2.0
"""Does a world last? A tour without an end.

``python -m scripts.experiments.endurance --minutes 120``.

Counts what must not happen in a long run: warnings of the physics, movers or the robot outside the
floor or inside a wall, numbers that are not finite, memory that grows. Ends with status 1 if any
did.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import numpy as np

from scripts.comparison.memory import reading_kb
from scripts.experiments.penetration import Depths
from sim.actors.rearranging import is_out
from sim.driving.pilot import Pilot
from sim.simulation import Simulation
from slam.frames import Float

GROWTH_MB = 8.0  # allowed after the first tenth
PARTS = 20  # of a run; what was found is printed after each


@dataclass
class Report:
    """What a run has shown so far."""

    escapes: dict[str, int] = field(default_factory=dict)
    not_finite: int = 0
    memory_mb: list[float] = field(default_factory=list)
    fastest: float = 0.0
    forces: dict[str, float] = field(default_factory=dict)  # peaks on the robot, N, by kind

    def look(self, simulation: Simulation) -> None:
        """Check everything as it is now."""
        world = simulation.world
        poses = world.mover_poses()
        self.not_finite += int(not np.isfinite(world.data.qpos).all())
        self.fastest = max(self.fastest, float(np.abs(world.data.qvel).max()))
        for mover, pose in zip(world.scene.movers, poses, strict=True):
            inside = mover.group != "door" and not is_out(pose, world.scene.bounds)
            if inside and _escaped(simulation, pose):
                self.escapes[mover.name] = self.escapes.get(mover.name, 0) + 1
        self.memory_mb.append(reading_kb("VmRSS") * 1024.0 / 1e6)

    @property
    def growth_mb(self) -> float:
        """From the first tenth of the run to its end."""
        settled = self.memory_mb[len(self.memory_mb) // 10]
        return self.memory_mb[-1] - settled


def _escaped(simulation: Simulation, pose: Float) -> bool:
    """Whether a mover's centre is off the floor or in a wall, a hull's radius too deep."""
    scene = simulation.world.scene
    xmin, ymin, xmax, ymax = scene.bounds
    x, y = float(pose[0]), float(pose[1])
    if not (xmin < x < xmax and ymin < y < ymax):
        return True
    raster = scene.static_map
    column = int((x - float(raster.T_map_origin[0])) / raster.resolution_m)
    row = int((y - float(raster.T_map_origin[1])) / raster.resolution_m)
    rows, columns = raster.values.shape
    return 0 <= row < rows and 0 <= column < columns and bool(raster.values[row, column] > 0.5)


def main() -> int:
    """Run, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="office")
    parser.add_argument("--minutes", type=float, default=120.0, help="simulated")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dynamism", type=float, default=0.8)
    parser.add_argument("--motion", type=float, help="apart from the dynamism")
    parser.add_argument("--change", type=float, help="apart from the dynamism")
    arguments = parser.parse_args()
    simulation = Simulation(
        arguments.scene,
        seed=arguments.seed,
        dynamism=arguments.dynamism,
        motion=arguments.motion,
        change=arguments.change,
    )
    pilot, report, began = Pilot(simulation.world), Report(), time.process_time()
    depths, scans = Depths(simulation), round(arguments.minutes * 60.0 / simulation.scan_period_s)
    for k in range(scans):
        simulation.world.set_command(*pilot.command(simulation.scan_period_s))
        simulation.observe()
        depths.look()
        for touch in simulation.contacts:
            report.forces[touch.kind] = max(report.forces.get(touch.kind, 0.0), touch.force)
        if k % 75 == 0:
            report.look(simulation)
        if (k + 1) % max(1, scans // PARTS) == 0 or k + 1 == scans:
            minutes, cpu = simulation.world.time_ns / 6e10, time.process_time() - began
            print(f"{minutes:.1f} min of {arguments.scene} in {cpu / 60.0:.1f} min of CPU")
            _print(report, depths, simulation)
    print(f"goals visited by the robot {pilot.driver.visited}")
    bad = bool(
        _warnings(simulation) or report.escapes or report.not_finite or report.growth_mb > GROWTH_MB
    )
    return int(bad)


def _warnings(simulation: Simulation) -> dict[int, int]:
    """How often MuJoCo gave each of its warnings."""
    return {k: w.number for k, w in enumerate(simulation.world.data.warning) if w.number}


def _print(report: Report, depths: Depths, simulation: Simulation) -> None:
    """All that there is to say so far: a run that is cut short has said it."""
    warnings, grown = _warnings(simulation), report.growth_mb
    print(f"  warnings {warnings}, escapes {report.escapes}, not finite {report.not_finite}")
    print(f"  memory {report.memory_mb[-1]:.0f} MB, grew by {grown:.1f} MB")
    print(f"  fastest joint {report.fastest:.1f} m/s or rad/s")
    walked, blocked = simulation.world.people.walked_s()
    if walked.sum() > 0.0:
        print(
            f"  people blocked {100.0 * blocked.sum() / walked.sum():.1f} % of their walking time"
        )
    for depth, at_s, one, two in sorted(depths.worst.values(), reverse=True)[:3]:
        print(f"  {one} and {two} were {1000.0 * depth:.0f} mm in each other at {at_s:.1f} s")
    peaks = ", ".join(f"{kind} {force:.0f} N" for kind, force in sorted(report.forces.items()))
    print(f"  the robot was touched by {peaks or 'nothing'}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
