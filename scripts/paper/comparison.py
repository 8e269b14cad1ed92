# SPDX-License-Identifier: Apache-2.0
"""The paper's table with ours beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scripts.paper.paper_numbers import Table
from scripts.paper.report import Report
from scripts.paper.runs import spread

Numbers = Mapping[str, Mapping[str, Any]]  # of one run: SLAM -> its numbers
_STATISTICS = (("mean", "mean(e)", 0), ("var_e", "var(e)", 1), ("var_p", "var(p)", 2))


def paper_table(
    report: Report, title: str, printed: Table, runs: Sequence[Numbers], columns: Sequence[str]
) -> None:
    """One row for each quantity and statistic: paper, our single run, median over the seeds.

    Of means the median over the seeds is that of their size, as signs differ from seed to seed.
    """
    many = len(runs) > 1
    ours = (
        "our single run, and medians with quartiles over the seeds, of means the median of their "
        "size"
        if many
        else "our one run"
    )
    report.say(
        f"**{title}**: the paper's numbers, {ours}. var(p) is printed, not compared.", quote=True
    )
    head = ["", "paper EKF", "paper “Our”"]
    head += [f"{name}, single run" for name in columns]
    if many:
        head += [f"{name}, {len(runs)} seeds" for name in columns]
    rows = []
    for quantity in printed["EKF"]:
        unit = "rad" if quantity == "θ" else "m"
        for key, label, place in _STATISTICS:
            squared = "" if place == 0 else "²"
            row = [f"{quantity}: {label}, {unit}{squared}"]
            row += [f"{printed[who][quantity][place]:.4f}" for who in ("EKF", "shunting")]
            row += [_cell(runs[0][name].get(f"{key} {quantity}")) for name in columns]
            if many:
                row += [
                    spread(abs(run[name].get(f"{key} {quantity}", float("nan"))) for run in runs)
                    .text("{:.2g}")
                    for name in columns
                ]  # fmt: skip
            rows.append(row)
    report.table(head, rows, quote=True)


def _cell(value: float | None) -> str:
    return "–" if value is None or value != value else f"{value:.3g}"


def below_printed(
    printed: Table, runs: Sequence[Numbers], name: str, *, limits: Mapping[str, Any] | None = None
) -> list[str]:
    """For each quantity, whether |mean| and var(e) (medians) are below the paper's "Our" or
    ``limits`` (quantity -> (mean, var)); in words, short-falls in bold."""
    out = []
    for quantity, (mean, var_e, _) in printed["shunting"].items():
        want = limits.get(quantity, (abs(mean), var_e)) if limits else (abs(mean), var_e)
        for key, most in (("mean", want[0]), ("var_e", want[1])):
            got = spread(
                abs(run[name].get(f"{key} {quantity}", float("nan"))) for run in runs
            ).median
            sign = "|mean(e)|" if key == "mean" else "var(e)"
            told = f"{quantity} {sign} {got:.2g} against {most:.2g}"
            out.append(told if got <= most else f"**{told}: short**")
    return out
