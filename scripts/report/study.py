# SPDX-License-Identifier: Apache-2.0
"""A comparison's tables, looked up by scene, level and SLAM, and what may be said of them."""

import os
from collections.abc import Container, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.comparison import tables
from scripts.comparison.folder import Compared, read
from scripts.comparison.run_file import RunFile
from scripts.comparison.schema import LEVELS, PAIRED, RUNS
from scripts.comparison.tables import Row
from scripts.metrics.table import METRICS, Metric
from scripts.names import DATASET
from scripts.output import RECIPE, read_recipe_words
from slam.errors import LogFormatError, MissingPathError
from slam.shaped import one_of

LEAST_RUNS = 6  # with fewer not even all wins are unlikely enough by chance (sign test, 5 %)
_SIGNED = ("median_difference", "low", "high")
WORST = 3  # runs of a scene that the page lists


@dataclass(frozen=True, eq=False)
class Study:
    """Rows by what they are about.

    asked  the SLAM that the page is about; None: the one named first
    """

    compared: Compared
    asked: str | None = None

    def __post_init__(self) -> None:
        if self.asked is not None:
            one_of("--subject", self.asked, self.slams)

    @cached_property
    def slams(self) -> list[str]:
        """In the order in which they were named."""
        return list(dict.fromkeys(str(row["slam"]) for row in self.compared.runs))

    @cached_property
    def scenes(self) -> list[str]:
        """In the order in which they were named."""
        return list(dict.fromkeys(str(row["scene"]) for row in self.compared.runs))

    @property
    def axis(self) -> str:
        """What the levels are of; rows call it "dynamism"."""
        return self.compared.axis

    @cached_property
    def levels(self) -> list[float]:
        """Of that axis, ascending."""
        return sorted({float(row["dynamism"]) for row in self.compared.runs})

    @property
    def subject(self) -> str:
        """The SLAM that the page is about."""
        return self.asked or self.slams[0]

    @property
    def rivals(self) -> list[str]:
        """All others."""
        return [slam for slam in self.slams if slam != self.subject]

    @property
    def few(self) -> bool:
        """Whether there are too few runs to say who is better, and for any interval."""
        return self.least_runs < LEAST_RUNS

    @cached_property
    def _by_level(self) -> dict[tuple[str, float, str, str], Row]:
        return {
            (row["scene"], row["dynamism"], row["slam"], row["metric"]): row
            for row in self.compared.levels
        }

    def level(self, scene: str, dynamism: float, slam: str, metric: str) -> Row | None:
        """The row of ``levels.csv``."""
        return self._by_level.get((scene, dynamism, slam, metric))

    def has(self, metric: str) -> bool:
        """Whether any SLAM has that number."""
        return any(row["metric"] == metric for row in self.compared.levels)

    def measures(self, keys: Iterable[str]) -> list[Metric]:
        """Those metrics that any SLAM has."""
        return [METRICS[key] for key in keys if self.has(key)]

    @cached_property
    def _by_pair(self) -> dict[tuple[str, float, str, str, str], Row]:
        found = {}
        for row in self.compared.paired:
            head = (row["scene"], row["dynamism"], row["metric"])
            found[(*head, row["slam_a"], row["slam_b"])] = row
            found[(*head, row["slam_b"], row["slam_a"])] = _turned(row)
        return found

    def pair(self, scene: str, dynamism: float, metric: str, a: str, b: str) -> Row | None:
        """``a`` against ``b``: the row of ``paired.csv``, turned where it is the other way."""
        return self._by_pair.get((scene, dynamism, metric, a, b))

    def runs(self, scene: str, dynamism: float, slam: str) -> list[Row]:
        """Rows of ``runs.csv``."""
        return [
            row
            for row in self.compared.runs
            if (row["scene"], row["dynamism"], row["slam"]) == (scene, dynamism, slam)
        ]

    @cached_property
    def least_runs(self) -> int:
        """Runs of a SLAM at a level, at the fewest."""
        return min(
            len(self.runs(scene, level, slam))
            for scene in self.scenes
            for level in self.levels
            for slam in self.slams
        )

    def run(self, row: Row) -> RunFile:
        """The file of a row's run."""
        return self.compared.run(row["scene"], row["dynamism"], row["seed"])

    def worst(self, scene: str, slam: str, outcomes: Container[str] | None = None) -> list[Row]:
        """Its worst runs, the very worst first: those that failed, then by the error.

        outcomes  of those that ended so alone
        """
        rows = [
            row
            for row in self.compared.runs
            if (row["scene"], row["slam"]) == (scene, slam)
            and (outcomes is None or row["outcome"] in outcomes)
        ]
        return sorted(rows, key=_badness, reverse=True)[:WORST]

    def typical(self, scene: str, dynamism: float, slam: str) -> Row:
        """Its run in the middle."""
        rows = sorted(self.runs(scene, dynamism, slam), key=_badness)
        return rows[(len(rows) - 1) // 2]


def _badness(row: Row) -> float:
    value = tables.number(row, "ate_unaligned_m")
    return -1.0 if value is None else value


def _turned(row: Row) -> Row:
    """The same pair the other way round."""
    minus = {key: None if row[key] is None else -row[key] for key in _SIGNED}
    return {
        **row, "slam_a": row["slam_b"], "slam_b": row["slam_a"], "wins": row["losses"],
        "losses": row["wins"], "median_difference": minus["median_difference"],
        "low": minus["high"], "high": minus["low"],
    }  # fmt: skip


def verdict(row: Row, less_is_better: bool) -> int:
    """1 where a of the pair is better, -1 where it is beaten, 0 where nobody can say.

    The 95 % interval of the paired difference excludes zero, and there are ``LEAST_RUNS``.
    """
    if row["n"] < LEAST_RUNS or row["low"] is None or row["high"] is None:
        return 0
    if row["low"] > 0.0:
        return -1 if less_is_better else 1
    if row["high"] < 0.0:
        return 1 if less_is_better else -1
    return 0


def study(folder: Path, subject: str | None = None) -> Study:
    """The comparison in ``folder``, about ``subject`` (the SLAM named first).

    Raises ``LogFormatError`` for one that is missing, old or damaged, as far as its recipe and
    tables tell: a run is read when it is shown. ``InvalidValueError`` for a subject that did not
    take part.
    """
    compared = read(folder)
    compared.check_tables()
    return Study(compared, subject)


MAKE = "mobilia compare --slam A B --out DIR makes a folder for it"
# What other commands left, and what to do with it instead.
_OTHERS = {
    **dict.fromkeys(("run", "demo"), f"a report is about a comparison, {MAKE}"),
    **dict.fromkeys(
        ("benchmark", "lifelong", "blame", "drive", "tune"), "index.html there is its page"
    ),
    "days": "days.csv has its scores",
}
_DATASET = (
    "is a dataset of mobilia generate. A report is about a comparison: " + MAKE + "; "
    "mobilia run SLAM --log EPISODE runs a SLAM on an episode"
)


def check_comparison(folder: Path) -> None:
    """``LogFormatError`` that names the missing verb, unless ``folder`` is of ``compare``."""
    if not folder.exists():
        raise MissingPathError(folder, f"no such folder: {MAKE}")
    if not folder.is_dir():
        raise LogFormatError(folder, f"is a file. A report is about a comparison: {MAKE}")
    if os.path.lexists(folder / DATASET):
        raise LogFormatError(folder, _DATASET)
    words = _recipe(folder)
    command = words.get("command")
    if command in _OTHERS:
        raise LogFormatError(folder, f"is of mobilia {command}: {_OTHERS[command]}")
    if command is None and "recipe" in words:
        raise LogFormatError(folder, _DATASET.replace("a dataset", "an episode"))
    if any(os.path.lexists(folder / name) for name in (RUNS, LEVELS, PAIRED)):
        return  # a comparison, or what is left of one: its reader says what is wrong
    if command == "compare":
        raise LogFormatError(folder, "is unfinished: the same mobilia compare again goes on")
    if not os.path.lexists(folder / RECIPE):
        raise LogFormatError(folder, f"holds no comparison: {MAKE}")


def _recipe(folder: Path) -> dict[str, Any]:
    """The words of the recipe; none where it is missing or damaged."""
    try:
        return read_recipe_words(folder / RECIPE)
    except LogFormatError:
        return {}
