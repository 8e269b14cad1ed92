# SPDX-License-Identifier: Apache-2.0
"""Is what changes out of sight as much as was asked for? On tours of the robot.

``python -m scripts.experiments.change_share --seconds 120 --seeds 3``.

A thing that was out of view at a moment of change is looked at when the scanner hits it again:
does it stand elsewhere by more than ``ELSEWHERE_M``? Nothing moves by itself meanwhile.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from scripts.experiments.measured import ended
from sim.moments import toured
from sim.simulation import Simulation

SCENES, SHARES = ("arena", "office", "classroom"), (0.25, 0.5, 0.75, 1.0)
ELSEWHERE_M = 0.3  # as the labels have it
FIRST_SEED = 300


def found(scene: str, share: float, seed: int, seconds: float) -> tuple[list[bool], Counter[str]]:
    """Whether each thing that was seen again stood elsewhere, and how things were changed."""
    simulation = Simulation(
        scene, seed=seed, dynamism=0.0, change=share, laser="lms221:noise", labels=True
    )
    owner, drawn = simulation.world.bodies.mover_of_body, set[int]()
    elsewhere: list[bool] = []
    how: Counter[str] = Counter()
    before = simulation.world.seen_since_drawn()
    for moment in toured(simulation, seconds):
        labels = moment.frame.labels
        assert labels is not None
        how.update(event.change for event in moment.rearranged)
        met = labels.body >= 0
        hit = dict(zip(owner[labels.body[met]].tolist(), labels.displacement[met], strict=True))
        after = simulation.world.seen_since_drawn()
        elsewhere += [bool(hit[row] > ELSEWHERE_M) for row in sorted(hit.keys() & drawn)]
        drawn -= hit.keys()
        drawn |= set(np.flatnonzero(before & ~after).tolist())
        before = after
    return elsewhere, how


def main() -> int:
    """A line for each scene and share."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=120.0, help="simulated, for each seed")
    arguments = parser.parse_args()
    for scene in arguments.scenes:
        for share in arguments.shares:
            elsewhere: list[bool] = []
            how: Counter[str] = Counter()
            began = time.process_time()
            for seed in range(FIRST_SEED, FIRST_SEED + arguments.seeds):
                more, changes = found(scene, share, seed, arguments.seconds)
                elsewhere += more
                how += changes
            cpu = time.process_time() - began
            rate = arguments.seeds * arguments.seconds / cpu
            share_seen = sum(elsewhere) / max(len(elsewhere), 1)
            print(
                f"{scene:10} change {share:.2f}: elsewhere {share_seen:.2f} of {len(elsewhere)} "
                f"seen again, {rate:.0f} x real time; {dict(sorted(how.items()))}"
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(ended(main))
