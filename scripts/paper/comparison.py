# SPDX-License-Identifier: Apache-2.0
"""The paper's tables with ours beside them.

Its var(p) do not follow from its own definition (var(p) = var(e) + n / (n - 1) mean^2, which
Table 3's x, for one, would make 0.0241 where 0.0781 is printed), so only means and var(e) compare.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scripts.paper.report import Report
from scripts.paper.runs import spread

# {SLAM: {quantity: (mean, var(e), var(p))}}
Table = dict[str, dict[str, tuple[float, float, float]]]
TABLE_1: Table = {
    "EKF": {
        "x": (0.6209, 0.0806, 0.6263), "y": (0.8744, 0.0447, 0.8755),
        "θ": (0.2119, 0.0048, 0.2173),
        "landmark x": (0.8316, 0.1098, 0.8982), "landmark y": (0.9793, 0.0697, 0.6169),
    },
    "shunting": {
        "x": (0.3408, 0.0424, 0.3435), "y": (0.5715, 0.0419, 0.5735),
        "θ": (0.1053, 0.0024, 0.0985),
        "landmark x": (0.7112, 0.0623, 0.6237), "landmark y": (0.8123, 0.0699, 0.5091),
    },
}  # fmt: skip
TABLE_2: Table = {
    "EKF": {
        "x": (-0.0598, 0.0649, 0.1114), "y": (-0.1138, 0.0412, 0.1208),
        "θ": (-0.0667, 0.0224, 0.0702),
        "landmark x": (-0.0702, 0.0899, 0.3012), "landmark y": (-0.1371, 0.0622, 0.2260),
    },
    "shunting": {
        "x": (0.0554, 0.0192, 0.0781), "y": (-0.0891, 0.0261, 0.0927),
        "θ": (-0.0547, 0.0166, 0.0574),
        "landmark x": (0.0692, 0.0437, 0.1191), "landmark y": (-0.1029, 0.0494, 0.1054),
    },
}  # fmt: skip
TABLE_3: Table = {
    "EKF": {
        "x": (-0.2339, 2.1564, 2.2190), "y": (0.4006, 1.4014, 1.4324),
        "θ": (0.9674, 1.1644, 1.4973),
    },
    "shunting": {
        "x": (0.0762, 0.0183, 0.0781), "y": (-0.0783, 0.0281, 0.0831),
        "θ": (-0.0565, 0.0166, 0.0592),
    },
}  # fmt: skip
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
