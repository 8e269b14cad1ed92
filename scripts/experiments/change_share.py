# SPDX-License-Identifier: Apache-2.0
"""Is what changes out of sight as much as was asked for? On tours of the robot.

``python -m scripts.experiments.change_share``. A thing that was out of view at a moment of change
is looked at when the scanner hits it again: does it stand elsewhere by more than ``ELSEWHERE_M``?
Nothing moves by itself meanwhile.
"""

from __future__ import annotations

import sys

import numpy as np

from scripts.experiments.shared import Row, of, share
from scripts.experiments.study import Study
from sim.moments import toured
from sim.simulation import Simulation

ELSEWHERE_M = 0.3  # as the labels have it


def run(case: Row) -> Row:
    """How many things were seen again, and how many of them stood elsewhere."""
    simulation = Simulation(
        case["scene"], seed=case["seed"], dynamism=0.0, change=case["change"],
        laser="lms221:noise", labels=True,
    )  # fmt: skip
    owner, drawn = simulation.world.bodies.mover_of_body, set[int]()
    found: list[bool] = []
    before = simulation.world.seen_since_drawn()
    for moment in toured(simulation, case["seconds"]):
        labels = moment.frame.labels
        assert labels is not None
        met = labels.body >= 0
        hit = dict(zip(owner[labels.body[met]].tolist(), labels.displacement[met], strict=True))
        after = simulation.world.seen_since_drawn()
        found += [bool(hit[row] > ELSEWHERE_M) for row in sorted(hit.keys() & drawn)]
        drawn -= hit.keys()
        drawn |= set(np.flatnonzero(before & ~after).tolist())
        before = after
    return {"again": len(found), "elsewhere": sum(found)}


STUDY = Study(
    name="change_share",
    axes={"scene": ("arena", "office", "classroom"), "change": (0.25, 0.5, 0.75, 1.0)},
    run=run, lines=("scene", "change"),
    columns={"elsewhere": share("elsewhere", "again"), "of": of("again", np.sum, form="{:.0f}")},
    defaults={"seeds": 3, "first_seed": 300, "seconds": 120.0},
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(STUDY.main())
