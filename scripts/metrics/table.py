# SPDX-License-Identifier: Apache-2.0
"""Every metric, one row each, in the order of the columns of ``runs.csv``.

``run`` scores with it, ``compare`` makes its columns and tables from it, ``report`` its pages,
``reproduce`` and the experiments compute by it: a new metric is a new row.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from scripts.metrics.judged import Judged
from slam.evaluation import metrics

Better = Literal["less", "more"]
Section = Literal["errors", "honesty", "costs", "maps", "drive"]


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One row of the table.

    key            its column in runs.csv, its name in levels.csv and paired.csv
    unit           of its value: SI and radians, ms and MB for costs
    better         None where neither less nor more is
    compute        None where ``scripts.comparison`` fills it: ``entry``, or ``make`` for
                   the section "drive"
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


DEG = 180.0 / math.pi
AXES = (("x", "m"), ("y", "m"), ("theta", "rad"))


def _dishonesty(run: Judged) -> float | None:
    ratio = run.nees_over_3()
    return None if ratio is None else abs(math.log(ratio))


_MOMENTS = {"mean_e": "mean error", "var_e": "variance of error", "var_p": "mean square error"}


def _moments() -> list[Metric]:
    """The paper's mean(e), var(e) and var(p) of x, y and heading."""

    def row(which: str, k: int, axis: str, unit: str) -> Metric:
        mean = which == "mean_e"
        form = ("{:+.5f}" if unit == "rad" else "{:+.4f}") if mean else "{:.2e}"
        return Metric(
            key=f"{which}_{axis}_{unit}" + ("" if mean else "2"),
            unit=unit if mean else unit + "²",
            compute=lambda run: float(getattr(run.statistics, "mean" if mean else which)[k]),
            label=f"{_MOMENTS[which]}, {axis}", section="errors", summary=None,
            least=-math.inf if mean else 0.0,
            in_run=f"{which}_{axis}", form=form,
        )  # fmt: skip

    return [row(which, k, axis, unit) for which in _MOMENTS for k, (axis, unit) in enumerate(AXES)]


def _count(key: str, section: Section, unit: str = "") -> Metric:
    """A column of ``runs.csv`` that is not summed up."""
    return Metric(key=key, unit=unit, label=key, section=section, summary=None, whole=not unit)


def _share(key: str, name: str, about: str, better: Better) -> Metric:
    return Metric(key=key, unit="", better=better, label=name, section="maps", name=name,
                  shown="%", factor=100.0, most=1.0, about=about)  # fmt: skip


# What has none of a SLAM that failed, and less is better.
_error = partial(Metric, better="less", section="errors", worst_if_failed=True, log=True)
_in_cm = partial(_error, unit="m", shown="cm", factor=100.0)
_time = partial(
    Metric, unit="ms", better="less", without_truth=True, section="costs", shown="ms", log=True
)
_ALL = (
    _in_cm(key="ate_unaligned_m", compute=lambda run: run.ate(), label="ATE, unaligned",
           in_run="ate_unaligned_m", name="position error (ATE)", curve=1, paired=True,
           about="root mean square distance between believed and true position over the run, "
           "online poses, unaligned: in the frame of the known first pose"),
    _in_cm(key="ate_se2_m", compute=lambda run: run.ate("se2"), label="ATE, SE(2)-aligned",
           in_run="ate_se2_m", name="position error, aligned",
           about="ATE after the best rigid alignment of the whole path: its shape alone"),
    _in_cm(key="ate_final_m", label="ATE, final", name="position error, final",
           compute=lambda run: metrics.ate(run.final or run.estimate, run.known).value,
           about="ATE of the poses as the SLAM sees them at the end, where it revises them"),
    _error(key="heading_rmse_rad", unit="rad", label="heading RMSE, unaligned",
           compute=lambda run: metrics.heading_rmse(run.estimate, run.known).value,
           in_run="heading_rmse_rad", form="{:.5f}",
           name="heading error", shown="°", factor=DEG, curve=4, paired=True,
           about="root mean square heading error, unaligned"),
    _in_cm(key="end_error_m", compute=lambda run: float(run.pairs.distances[-1]),
           label="error at the end, unaligned", in_run="end_error_m", name="error at the end",
           about="distance between believed and true position at the last scan"),
    _in_cm(key="error_tracking_m", compute=lambda run: run.error_while_tracking(),
           label="position error while not lost", worst_if_failed=False, tabled=False,
           name="position error while not lost",
           about="root mean square distance between believed and true position, up to the moment "
           "in which the SLAM lost its way; the whole run where it did not"),
    _error(key="rpe_m_per_m", unit="m/m", compute=lambda run: run.rpe("m", 0),
           label="RPE per metre", name="drift per metre", shown="cm/m", factor=100.0,
           curve=3, paired=True, about="relative position error over each metre driven"),
    _error(key="rpe_rad_per_m", unit="rad/m", compute=lambda run: run.rpe("m", 1),
           label="heading RPE per metre", tabled=False, name="turn drift per metre",
           shown="°/m", factor=DEG, about="relative heading error over each metre driven"),
    _error(key="rpe_m_per_s", unit="m/s", compute=lambda run: run.rpe("s", 0),
           label="RPE per second", tabled=False, name="drift per second", shown="cm/s",
           factor=100.0, about="relative position error over each second"),
    _error(key="rpe_rad_per_s", unit="rad/s", compute=lambda run: run.rpe("s", 1),
           label="heading RPE per second", tabled=False, name="turn drift per second",
           shown="°/s", factor=DEG, about="relative heading error over each second"),
    *_moments(),
    Metric(key="lost", unit="", better="less", label="lost", section="errors", summary="share",
           name="runs lost", shown="%", factor=100.0, curve=2, paired=True, most=1.0, whole=True,
           about="share of runs in which the SLAM failed or lost its way, see Outcomes"),
    _count("lost_at_s", "errors", "s"),
    Metric(key="nees_over_3", unit="", compute=lambda run: run.nees_over_3(),
           label="NEES / 3", section="honesty", name="NEES / 3", log=True, curve=5,
           about="squared error measured by the SLAM's own covariance, over its three "
           "dimensions, mean of a run: 1 is honest, above is overconfident, below is timid"),
    Metric(key="nees_abs_log", unit="", better="less", compute=_dishonesty,
           label="|ln NEES/3|", section="honesty", tabled=False,
           name="dishonesty", shown="|ln NEES/3|", about="how far NEES / 3 is from 1, either way"),
    Metric(key="not_trusted_share", unit="",
           compute=lambda run: float(np.mean([not e.converged for e in run.estimates])),
           label="share of scans it did not trust", section="honesty",
           name="scans it did not trust", shown="%", factor=100.0, most=1.0,
           about="share of estimates that the SLAM itself marked as not converged"),
    Metric(key="silent_share", unit="", better="less", compute=lambda run: run.silent_share(),
           label="share of silent failures", section="honesty",
           name="silent failures", shown="%", factor=100.0, most=1.0,
           about="share of scans that are more than 10 cm off, beyond 3 sigma of the SLAM's own "
           "covariance, and still marked as converged; empty where it claims no covariance"),
    _time(key="ms_per_scan_p50", compute=lambda run: run.milliseconds(50.0),
          label="CPU per scan, p50", in_run="ms_per_scan_p50", form="{:.2f}",
          name="time per scan, median", about="processor time of one update, all threads"),
    _time(key="ms_per_scan_p99", compute=lambda run: run.milliseconds(99.0),
          label="CPU per scan, p99", in_run="ms_per_scan_p99", form="{:.2f}",
          name="time per scan, 99th percentile",
          about="the slow ones: what a real-time budget must hold"),
    _time(key="ms_per_scan_p999", compute=lambda run: run.milliseconds(99.9),
          label="CPU per scan, p99.9", tabled=False, name="time per scan, 99.9th percentile",
          about="the slowest ones: of a run of less than 1000 scans the slowest"),
    Metric(key="real_time_factor", unit="×", without_truth=True, summary=None, column=False,
           compute=lambda run: run.real_time_factor(), label="real-time factor of the SLAM",
           section="costs", in_run="real_time_factor", form="{:.1f}"),
    Metric(key="not_converged", unit="", without_truth=True, summary=None, column=False,
           compute=lambda run: sum(not e.converged for e in run.estimates),
           label="scans it did not trust", section="costs", in_run="not_converged", form="{:d}"),
    Metric(key="peak_memory_mb", unit="MB", better="less", label="memory", section="costs",
           name="memory", shown="MB", log=True,
           about="growth of resident memory at its highest"),
    _share("ghost_rate", "ghosts", "share of occupied cells with nothing within 15 cm", "less"),
    _share("new_object_recall", "new objects found",
           "of what stands at a new place for 2 s and was seen in 5 scans, the share that "
           "the map holds", "more"),
    _count("new_objects", "maps"),
    _count("duration_s", "drive", "s"),
    Metric(key="distance_m", unit="m", label="distance driven", section="drive"),
    Metric(key="moving_share_of_returns", unit="", label="returns from what moves",
           section="drive", most=1.0),
    Metric(key="semi_static_share_of_returns", unit="", label="returns from what was moved",
           section="drive", most=1.0),
)  # fmt: skip

METRICS = {metric.key: metric for metric in _ALL}

COLUMNS = tuple(m.key for m in _ALL if m.column)
DRIVES = tuple(m.key for m in _ALL if m.section == "drive" and m.compute is None)
JUDGED = tuple(m.key for better in ("less", "more") for m in _ALL if m.better == better)
SHARES = tuple(m.key for m in _ALL if m.summary == "share")
MEDIANS = (
    *(key for key in JUDGED if key not in SHARES),
    *(m.key for m in _ALL if m.summary == "median" and m.better is None),
)
IN_RUN = tuple(m for m in _ALL if m.in_run)

_SECTIONS: tuple[Section, ...] = ("errors", "honesty", "costs", "maps")
# The report explains them section by section, what it draws first.
EXPLAINED = tuple(
    m
    for section in _SECTIONS
    for m in sorted(_ALL, key=lambda m: m.curve or len(_ALL))
    if m.section == section and m.name
)
CURVES = tuple(m.key for m in EXPLAINED if m.curve)
PAIRED = tuple(m.key for m in sorted(EXPLAINED, key=lambda m: m.summary == "share") if m.paired)


def of_section(section: Section) -> tuple[str, ...]:
    """The metrics in the report's table of it."""
    return tuple(m.key for m in EXPLAINED if m.section == section and m.tabled)
