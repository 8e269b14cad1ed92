# SPDX-License-Identifier: Apache-2.0
"""What a row of the table of metrics (``table``) is: column, computation, how it is shown."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from scripts.metrics.judged import Judged

Better = Literal["less", "more"]
Section = Literal["errors", "honesty", "costs", "maps", "drive"]


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One row of the table.

    key            its column in runs.csv, its name in levels.csv and paired.csv
    unit           of its value: SI and radians, ms and MB for costs
    better         None where neither less nor more is
    compute        None where the code that watches the run fills it: outcome, memory, maps, drive
    label          technical name, as ``run`` prints it
    section        where the report shows it
    summary        how runs are summed up in levels.csv; None: it is a column of runs.csv alone
    column         False: only ``run`` has it
    without_truth  what it is computed from needs no true poses
    worst_if_failed  a SLAM that failed has none, which must not flatter its median
    in_run         its key in results.json of ``run``; "" where that does not have it
    form           format in the table of ``run``
    name           plain words for the report; "" where that does not explain it
    shown          the report's unit, which is ``factor`` times ``unit``
    log            drawn on a logarithmic axis
    least, most    of its values in runs.csv; infinite ones are there where ``most`` is
    whole          its values are whole numbers
    about          one sentence for people who have not read the code
    curve          place among the report's curves, from 1; 0: not drawn
    paired         in the report's table of pairs
    tabled         in the report's table of its section
    """

    key: str
    unit: str
    better: Better | None = None
    compute: Callable[[Judged], float | None] | None = None
    label: str = ""
    section: Section
    summary: Literal["median", "share"] | None = "median"
    column: bool = True
    without_truth: bool = False
    worst_if_failed: bool = False
    in_run: str = ""
    form: str = "{:.4f}"
    name: str = ""
    shown: str = ""
    factor: float = 1.0
    log: bool = False
    least: float = 0.0
    most: float = math.inf
    whole: bool = False
    about: str = ""
    curve: int = 0
    paired: bool = False
    tabled: bool = True

    @property
    def heading(self) -> str:
        """Name and unit, as the report has them."""
        return f"{self.name}, {self.shown}" if self.shown else self.name

    @property
    def less_is_better(self) -> bool | None:
        """None where neither is."""
        return None if self.better is None else self.better == "less"

    def of(self, run: Judged) -> float | None:
        """Its value in ``unit``; None where the run has none."""
        if self.compute is None or (run.truth is None and not self.without_truth):
            return None
        return self.compute(run)

    def show(self, value: float | None, *, sign: bool = False) -> str:
        """A value of the tables in the report's unit, three digits."""
        if value is None or math.isnan(value):
            return "–"
        return digits(value * self.factor, sign=sign)


def minus(text: str) -> str:
    """A formatted number with the minus sign that all of ours have."""
    return text.replace("-", "−")


def digits(value: float, *, sign: bool = False) -> str:
    """Three significant digits without an exponent; ∞ for what failed."""
    mark = "−" if value < 0.0 else "+" if sign and value > 0.0 else ""
    size = abs(value)
    if math.isinf(size):
        return mark + "∞"
    if size == 0.0:
        return "0"
    if size < 1e-4 or size >= 1e6:
        return minus(mark + f"{size:.1e}")
    places = max(0, 2 - math.floor(math.log10(float(f"{size:.2e}"))))
    return mark + f"{size:.{places}f}"
