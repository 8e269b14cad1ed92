# SPDX-License-Identifier: Apache-2.0
"""Scans in physics steps: which steps a scan lies over, and between which two each beam comes.

A scan may begin between two steps. The part of a step by which it began before the step that the
world stands at is its phase; a scan with a phase needs the poses of the step before, too. Steps of
a scan are counted in rows: row 0 is the last step at or before its start.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar.caster import FanPlan
from sim.sensors.lidar.scanner import Scanner
from slam.frames import LaserSpec

Fan = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]  # beams, rows, parts
KEPT = 64  # windows of as many phases are kept; further ones are made when they are needed


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """One scan among the physics steps.

    before   0 or 1: the row of the step that the world stands at when the scan is begun
    last     row at which the scan is over and the world is left
    marks    (last + 1,) whether poses are noted at that row
    first    row, with its fraction, of the scan's start
    plan     the beams among the notes
    next     phase of the scan that follows; ``repeats``: it is that of this one, 0
    """

    before: int
    last: int
    marks: NDArray[np.bool_]
    first: float
    plan: FanPlan
    next: Fraction
    repeats: bool

    @property
    def steps(self) -> int:
        """Physics steps to make."""
        return self.last - self.before


def schedule(scanner: Scanner, spec: LaserSpec, steps_per_s: int) -> Callable[[Fraction], Window]:
    """The windows of a scanner by their phase, each made once."""
    made: dict[Fraction, Window] = {}

    def window(phase: Fraction) -> Window:
        if phase not in made:
            if len(made) >= KEPT:
                made.clear()
            made[phase] = _window(scanner, spec, steps_per_s, phase)
        return made[phase]

    return window


def most_notes(scanner: Scanner, steps_per_s: int) -> int:
    """The most rows of any window."""
    return math.ceil(scanner.period_s * steps_per_s) + 2


def _window(scanner: Scanner, spec: LaserSpec, steps_per_s: int, phase: Fraction) -> Window:
    period = scanner.period_s * steps_per_s
    before = 1 if phase else 0
    begin = before - phase
    last = before + math.ceil(period - phase)
    after = last - begin - period  # by which the world is past the start of the next scan
    fans = [_fan(scanner, begin, k, steps_per_s) for k in range(scanner.turns)]
    marks = np.zeros(last + 1, dtype=np.bool_)
    for _, rows, _ in fans:
        marks[rows.min() : rows.max() + 2] = True
    if after:  # the next scan begins in the last step
        marks[last - 1 :] = True
    if phase:  # the two are noted when the scan is begun
        marks[:2] = True
    slots = np.cumsum(marks) - 1
    return Window(
        before=before,
        last=last,
        marks=marks,
        first=float(begin),
        plan=FanPlan.of([(b, spec.angles[b], slots[rows], parts) for b, rows, parts in fans]),
        next=after,
        repeats=not phase and not after,
    )


def _fan(scanner: Scanner, begin: Fraction, turn: int, steps_per_s: int) -> Fan:
    """Beams of a turn, the rows before them and the parts of the way to the rows after them."""
    beams = np.flatnonzero(scanner.turn_of == turn)
    start = begin + turn * scanner.turn_s * steps_per_s
    base = math.floor(start)
    within = scanner.share_of_turn[beams] * float(scanner.turn_s * steps_per_s)
    if start != base:
        within = within + float(start - base)
    # A beam at the very end of the last step belongs to that step.
    rows = np.minimum(np.floor(within), max(math.ceil(float(within.max())) - 1, 0))
    return beams, base + rows.astype(np.int64), within - rows
