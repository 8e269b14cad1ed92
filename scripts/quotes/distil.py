# SPDX-License-Identifier: Apache-2.0
"""A comparison's folder as a results file: ``python -m scripts.quotes.distil out/compare``.

Writes ``docs/results/comparison.json``, or what ``--out`` names, with the metrics that pages quote.
A folder that the code here would make again is refused: then the results would name a commit that
did not make them.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scipy.stats import spearmanr

from scripts.comparison.csv_files import Row
from scripts.comparison.folder import Compared, read
from scripts.comparison.plan import ENTRIES, RECORDINGS, Plan
from scripts.comparison.tables import by_seed
from scripts.experiments.measured import ended
from scripts.metrics.table import METRICS
from scripts.result_files import RESULTS, SCHEMA, commit, write
from slam.errors import InvalidValueError
from slam.evaluation.statistics import paired, quantile

OURS = "shunting"
CODE = ("slam", "sim", "scenes", "scripts/comparison")  # what decides the numbers
QUOTED = (
    "ate_unaligned_m", "ate_se2_m", "heading_rmse_rad", "lost", "ms_per_scan_p50", "ghost_rate",
    "ghost_left_rate", "half_life_s", "half_life_observations", "new_object_recall",
    "door_accuracy",
)  # fmt: skip
OTHER = ("moving_share_of_returns",)
CORRELATED = ("ate_unaligned_m", "ate_se2_m", "lost", "moving_share_of_returns")
LEAST_LEVELS = 3  # of a rank correlation
HEAD = ("scenes", "slams", "levels", "seeds", "seconds", "every", "scanner")
COLUMN_OF = {"levels": "dynamism"}
PLANNED = ("slams", "scenes", "levels", "seeds", "seconds", "every", "scanner", "scan_limit_s")


def distil(compared: Compared, command: str) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Head and tables of the results file."""
    settings = compared.recipe["settings"]
    head = {
        "schema": SCHEMA,
        "command": command,
        "commit": commit(*CODE),
        "machine": settings["machine"],
        "versions": compared.recipe["versions"],
        **{COLUMN_OF.get(key, key): settings[key] for key in HEAD},
        "columns": {
            "levels": "for each dynamism: median (lost: share), low and high of its 95 % interval",
            "paired": f"for each dynamism: median of {OURS} less the other, run by run, low and "
            "high of its 95 % interval, runs won, tied and lost by it",
            "over_levels": "the same of each seed's median difference over the dynamisms",
            "rank_correlation": "Spearman's, of dynamism with the medians",
        },
    }
    tables = {
        "levels": _levels(compared),
        **_paired(compared),
        "rank_correlation": _correlations(compared),
    }
    return head, tables


def _levels(compared: Compared) -> dict[str, Any]:
    """A cell for each level, null where nothing was measured."""
    settings = compared.recipe["settings"]
    found = {
        (row["scene"], row["slam"], row["metric"], row["dynamism"]): row for row in compared.levels
    }
    table = {}
    for scene in settings["scenes"]:
        for slam in settings["slams"]:
            for metric in (*QUOTED, *OTHER):
                rows = [found.get((scene, slam, metric, level)) for level in settings["levels"]]
                cells = [row and [row["value"], row["low"], row["high"]] for row in rows]
                if any(cells):
                    table[f"{scene} {slam} {metric}"] = cells
    return table


def _paired(compared: Compared) -> dict[str, dict[str, Any]]:
    settings = compared.recipe["settings"]
    by_level, over = {}, {}
    for scene in settings["scenes"]:
        for rival in settings["slams"]:
            for metric in QUOTED if rival != OURS else ():
                ours, theirs = (_by_level(compared, scene, slam, metric) for slam in (OURS, rival))
                levels = [_differences(a, b) for a, b in zip(ours, theirs, strict=True)]
                if not any(levels):
                    continue
                key, less = f"{scene} {rival} {metric}", METRICS[metric].better == "less"
                by_level[key] = [_cell(list(level.values()), less) for level in levels]
                seeds = sorted({seed for level in levels for seed in level})
                middles = [
                    quantile([level[seed] for level in levels if seed in level], 0.5)
                    for seed in seeds
                ]
                over[key] = _cell(middles, less)
    return {"paired": by_level, "over_levels": over}


def _by_level(compared: Compared, scene: str, slam: str, metric: str) -> list[dict[int, float]]:
    """For each level, by seed: what there is a number of."""
    at: dict[float, list[Row]] = {}
    for row in compared.runs:
        if row["scene"] == scene:
            at.setdefault(row["dynamism"], []).append(row)
    levels = compared.recipe["settings"]["levels"]
    return [by_seed(at.get(level, []), slam, metric) for level in levels]


def _differences(a: dict[int, float], b: dict[int, float]) -> dict[int, float]:
    """By seed; two infinite numbers are a tie."""
    return {
        seed: 0.0 if a[seed] == b[seed] else a[seed] - b[seed]
        for seed in sorted(a.keys() & b.keys())
    }


def _cell(differences: list[float], less: bool) -> list[Any] | None:
    if not differences:
        return None
    row = paired(differences, [0.0] * len(differences), less_is_better=less)
    return [row[key] for key in ("median_difference", "low", "high", "wins", "ties", "losses")]


def _correlations(compared: Compared) -> dict[str, float]:
    """Spearman's rho of level and value; NaN of fewer than three, or where all are the same."""
    found: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    for row in compared.levels:
        if row["metric"] in CORRELATED:
            key = row["scene"], row["slam"], row["metric"]
            found.setdefault(key, []).append((row["dynamism"], row["value"]))
    return {" ".join(key): _spearman(pairs) for key, pairs in found.items()}


def _spearman(pairs: list[tuple[float, float]]) -> float:
    levels, values = zip(*pairs, strict=True)
    if len(pairs) < LEAST_LEVELS or len(set(values)) == 1:
        return math.nan
    return float(spearmanr(levels, values).statistic)


def refuse_of_other_code(compared: Compared) -> None:
    """Raise ``InvalidValueError`` where the code here would make a part of it again."""
    settings: Row = compared.recipe["settings"]
    planned: dict[str, Any] = {
        key: tuple(settings[key]) if isinstance(settings[key], list) else settings[key]
        for key in PLANNED
    }
    plan = Plan(**planned)
    recordings = [(RECORDINGS, job) for job in plan.recordings().values()]
    for folder, job in [*recordings, *((ENTRIES, job) for _, _, job in plan.entries())]:
        if not (compared.folder / folder / job.file_name()).exists():
            raise InvalidValueError(
                f"{compared.folder}: {job.name} in {folder} was not made by the code here: run the "
                "comparison again"
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the results file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of mobilia compare")
    parser.add_argument("--command", required=True, help="that made it, as the page prints it")
    parser.add_argument("--out", type=Path, default=RESULTS / "comparison.json")
    wanted = parser.parse_args(arguments)
    compared = read(wanted.folder)
    refuse_of_other_code(compared)
    write(wanted.out, *distil(compared, wanted.command))
    print(f"wrote {wanted.out}")
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))
