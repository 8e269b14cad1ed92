# SPDX-License-Identifier: Apache-2.0
"""How long the experiments take, however often they were killed and gone on with."""

from __future__ import annotations

from collections.abc import Sequence

from scripts.machine import machine
from scripts.output import RECIPE, read_recipe_words
from scripts.paper.runs import Plan

TARGET_S = 45 * 60.0  # all experiments, on 2 cores


def duration(seconds: float) -> str:
    """``13 s``, ``41 min``."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def total(plan: Plan, names: Sequence[str], wall_s: float) -> str:
    """How long these experiments took together, from their recipes."""
    recipes = [read_recipe_words(plan.out / name / RECIPE)["settings"] for name in names]
    cpu_s = sum(recipe["cpu_s"] for recipe in recipes)
    one_s = sum(recipe["page_cpu_s"] for recipe in recipes)  # of one process, after the runs
    two_s = (cpu_s - one_s) / 2.0 + one_s
    made_on = machine()
    told = (
        f"{', '.join(names)} together: processor time {duration(cpu_s)}, that is "
        f"{duration(two_s)} on 2 cores; wall time of this call {duration(wall_s)}, "
        f"{plan.processes} at a time on {made_on['processor']}, {made_on['cores']} cores."
    )
    if plan.quick:
        return told
    return f"{told} The target is 45 min on 2 cores: " + (
        "met." if two_s <= TARGET_S else "**missed.**"
    )
