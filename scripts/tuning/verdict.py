# SPDX-License-Identifier: Apache-2.0
"""What fresh seeds say of the numbers that the search found: a gain, or none that they confirm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from scripts.comparison.tables import Row, by_seed
from scripts.report.answer import ODOMETRY, percent
from slam.evaluation.statistics import paired, quantile, ratio_interval

LEVEL = 0.025  # of the sign tests: two questions are asked, and both together err in 1 of 20
ERROR, COST = "ate_unaligned_m", "ms_per_scan_p50"


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Two SLAMs on the same fresh runs.

    gain   in which of the two questions the second is better
    lost   runs lost by each, of ``runs``
    of_lost, of_error  the second against the first (``slam.evaluation.statistics.paired``): in what
           they lose, and in the error of the runs that both held
    ratio  of the medians of that error, with its interval
    ms     of a scan, medians;  odometry_lost  runs that it loses alone, if it ran
    """

    gain: Literal["lost", "error", ""]
    runs: int
    lost: tuple[int, int]
    of_lost: Mapping[str, Any]
    of_error: Mapping[str, Any]
    ratio: tuple[float, float, float]
    ms: tuple[float, float]
    odometry_lost: int

    @property
    def sentence(self) -> str:
        """The result in one line."""
        of_lost, of_error = self.of_lost, self.of_error
        before, after = (f"{k} (95 %: {percent(k, self.runs)})" for k in self.lost)
        fewer, low, high = (100.0 * (1.0 - one) for one in self.ratio)
        error = (
            f"where both hold the error is {abs(fewer):.0f} % {'lower' if fewer >= 0 else 'higher'}"
            f" (95 %: {min(low, high):.0f} to {max(low, high):.0f} %), "
            f"lower in {of_error['wins']} of {of_error['n']} (p = {of_error['p_sign']:.2g})"
        )
        lost = (
            f"lost in {after} of {self.runs} fresh runs instead of {before}: "
            f"{of_lost['wins']} saved, {of_lost['losses']} lost anew (p = {of_lost['p_sign']:.2g})"
        )
        if self.gain == "lost":
            return f"{lost[0].upper()}{lost[1:]}."
        if self.gain == "error":
            return f"{error[0].upper()}{error[1:]}; {lost}."
        tells = 2.0 * 0.5 ** of_error["n"] < LEVEL  # else not even all wins would
        return f"No gain that fresh seeds confirm: {lost}" + (f"; {error}." if tells else ".")


def judge(rows: Sequence[Row], before: str, after: str) -> Verdict:
    """Of the rows of ``runs.csv`` with both SLAMs on the same seeds."""
    lost = [by_seed(rows, slam, "lost") for slam in (before, after)]
    error = [by_seed(rows, slam, ERROR) for slam in (before, after)]
    seeds = sorted(lost[0].keys() & lost[1].keys())
    held = [seed for seed in seeds if not lost[0][seed] and not lost[1][seed]]
    of_lost = paired(*([one[s] for s in seeds] for one in lost[::-1]), less_is_better=True)
    errors = [[one[seed] for seed in held] for one in error]
    of_error = paired(errors[1], errors[0], less_is_better=True)
    medians = tuple(quantile(one, 0.5) for one in errors)
    counts = tuple(int(sum(one[seed] for seed in seeds)) for one in lost)
    ms = [quantile([*by_seed(rows, slam, COST).values()], 0.5) for slam in (before, after)]
    gain: Literal["lost", "error", ""] = ""
    if of_lost["p_sign"] < LEVEL and counts[1] < counts[0]:
        gain = "lost"
    elif of_error["p_sign"] < LEVEL and of_error["wins"] > of_error["losses"]:
        gain = "error" if counts[1] <= counts[0] else ""
    ratio = medians[1] / medians[0] if held and medians[0] > 0.0 else 1.0
    return Verdict(
        gain=gain, runs=len(seeds), lost=(counts[0], counts[1]), of_lost=of_lost,
        of_error=of_error, ratio=(ratio, *ratio_interval(*errors)), ms=(ms[0], ms[1]),
        odometry_lost=int(sum(by_seed(rows, ODOMETRY, "lost").values())),
    )  # fmt: skip
