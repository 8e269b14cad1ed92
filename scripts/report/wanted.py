# SPDX-License-Identifier: Apache-2.0
"""Is a folder one that ``mobilia report`` takes? If not, which verb is missing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from scripts.comparison.schema import LEVELS, PAIRED, RUNS
from scripts.names import DATASET
from scripts.output import RECIPE, read_recipe_words
from slam.errors import LogFormatError, MissingPathError

MAKE = "mobilia compare --slam A B --out DIR makes a folder for it"
# What other commands left, and what to do with it instead.
_OTHERS = {
    "run": f"is of mobilia run. A report is about a comparison: {MAKE}; "
    "mobilia blame {folder} says what misled this run",
    "demo": f"is of mobilia demo. A report is about a comparison: {MAKE}; "
    "mobilia render {folder} films this run",
    "drive": "is of mobilia drive. It is a part of the report on a comparison: "
    "mobilia report COMPARISON --drive {folder}",
    "benchmark": "is of mobilia benchmark: leaderboard.md there is its report; "
    "each track has one, mobilia report {folder}/TRACK",
    "days": "is of the benchmark's section over days: days.csv has its scores",
    "lifelong": "is of mobilia lifelong: lifelong.md there is its report",
    "blame": "is of mobilia blame: blame.png there is its report",
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
        raise LogFormatError(folder, _OTHERS[command].format(folder=folder))
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
