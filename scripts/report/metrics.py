# SPDX-License-Identifier: Apache-2.0
"""The columns of a comparison as a reader wants them: named, in handy units, explained."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scripts.comparison.columns import LESS_IS_BETTER, MORE_IS_BETTER

DEG = 180.0 / math.pi


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One column: what it is called, the unit it is shown in and the factor to it.

    log   drawn on a logarithmic axis
    about one sentence for people who have not read the code
    """

    key: str
    name: str
    unit: str
    about: str
    factor: float = 1.0
    log: bool = False

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def less_is_better(self) -> bool | None:
        """None where neither is."""
        if self.key in LESS_IS_BETTER:
            return True
        return False if self.key in MORE_IS_BETTER else None

    def show(self, value: float | None, *, sign: bool = False) -> str:
        """A value of the tables in ``unit``, three digits."""
        if value is None or math.isnan(value):
            return "–"
        return digits(value * self.factor, sign=sign)


def digits(value: float, *, sign: bool = False) -> str:
    """Three significant digits without an exponent; ∞ for what failed."""
    mark = "−" if value < 0.0 else "+" if sign and value > 0.0 else ""
    size = abs(value)
    if math.isinf(size):
        return mark + "∞"
    if size == 0.0:
        return "0"
    if size < 1e-4 or size >= 1e6:
        return mark + f"{size:.1e}"
    places = max(0, 2 - math.floor(math.log10(float(f"{size:.2e}"))))
    return mark + f"{size:.{places}f}"


_ALL = (
    Metric(key="ate_unaligned_m", name="position error (ATE)", unit="cm", factor=100.0, log=True,
           about="root mean square distance between believed and true position over the run, "
           "online poses, unaligned: in the frame of the known first pose"),
    Metric(key="lost", name="runs lost", unit="%", factor=100.0,
           about="share of runs in which the SLAM failed or lost its way, see Outcomes"),
    Metric(key="rpe_m_per_m", name="drift per metre", unit="cm/m", factor=100.0, log=True,
           about="relative position error over each metre driven"),
    Metric(key="heading_rmse_rad", name="heading error", unit="°", factor=DEG, log=True,
           about="root mean square heading error, unaligned"),
    Metric(key="ate_se2_m", name="position error, aligned", unit="cm", factor=100.0, log=True,
           about="ATE after the best rigid alignment of the whole path: its shape alone"),
    Metric(key="ate_final_m", name="position error, final", unit="cm", factor=100.0, log=True,
           about="ATE of the poses as the SLAM sees them at the end, where it revises them"),
    Metric(key="end_error_m", name="error at the end", unit="cm", factor=100.0, log=True,
           about="distance between believed and true position at the last scan"),
    Metric(key="rpe_rad_per_m", name="turn drift per metre", unit="°/m", factor=DEG, log=True,
           about="relative heading error over each metre driven"),
    Metric(key="rpe_m_per_s", name="drift per second", unit="cm/s", factor=100.0, log=True,
           about="relative position error over each second"),
    Metric(key="rpe_rad_per_s", name="turn drift per second", unit="°/s", factor=DEG, log=True,
           about="relative heading error over each second"),
    Metric(key="nees_over_3", name="NEES / 3", unit="", log=True,
           about="squared error measured by the SLAM's own covariance, over its three "
           "dimensions, mean of a run: 1 is honest, above is overconfident, below is timid"),
    Metric(key="nees_abs_log", name="dishonesty", unit="|ln NEES/3|",
           about="how far NEES / 3 is from 1, either way"),
    Metric(key="not_trusted_share", name="scans it did not trust", unit="%", factor=100.0,
           about="share of estimates that the SLAM itself marked as not converged"),
    Metric(key="ms_per_scan_p50", name="time per scan, median", unit="ms", log=True,
           about="processor time of one update, all threads"),
    Metric(key="ms_per_scan_p99", name="time per scan, 99th percentile", unit="ms", log=True,
           about="the slow ones: what a real-time budget must hold"),
    Metric(key="peak_memory_mb", name="memory", unit="MB", log=True,
           about="growth of resident memory at its highest"),
    Metric(key="ghost_rate", name="ghosts", unit="%", factor=100.0,
           about="share of occupied cells with nothing within 15 cm"),
    Metric(key="ghost_left_rate", name="ghosts left behind", unit="%", factor=100.0,
           about="share of occupied cells where a mover was seen before and nothing is now"),
    Metric(key="new_object_recall", name="new objects found", unit="%", factor=100.0,
           about="of what stands at a new place for 2 s and was seen in 5 scans, the share that "
           "the map holds"),
    Metric(key="half_life_s", name="half-life of a moved chair", unit="s",
           about="Kaplan-Meier median over what was moved: how long the map shows it at its old "
           "place after the scan that first sees that empty; ∞ where most outlast the watch"),
    Metric(key="half_life_observations", name="half-life of a moved chair", unit="looks",
           about="the same, in scans that looked there"),
    Metric(key="door_accuracy", name="doors right", unit="%", factor=100.0,
           about="of doors seen in the last 2 s and closed or open, the share that the map shows "
           "so"),
)  # fmt: skip
METRICS = {metric.key: metric for metric in _ALL}

CURVES = ("ate_unaligned_m", "lost", "rpe_m_per_m", "heading_rmse_rad", "nees_over_3")
ERRORS = (
    "ate_unaligned_m", "lost", "rpe_m_per_m", "heading_rmse_rad", "ate_se2_m", "ate_final_m",
    "end_error_m",
)  # fmt: skip
PAIRED = ("ate_unaligned_m", "rpe_m_per_m", "heading_rmse_rad", "lost")
HONESTY = ("nees_over_3", "not_trusted_share")
COSTS = ("ms_per_scan_p50", "ms_per_scan_p99", "peak_memory_mb")
MAPS = (
    "ghost_rate", "ghost_left_rate", "new_object_recall", "half_life_s",
    "half_life_observations", "door_accuracy",
)  # fmt: skip
