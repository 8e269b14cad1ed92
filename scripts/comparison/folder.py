# SPDX-License-Identifier: Apache-2.0
"""The tables and files of a comparison, and how to read them back.

compared = read(Path("out/compare"))
compared.runs[0]["ate_unaligned_m"]                     # a row of runs.csv, None for empty
run = compared.run("office", 0.5, 100)                   # a file of runs/
run.believed("shunting").poses, run.truth, run.static_map

What they must hold is said in ``schema``.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

from scripts.comparison.plan import Run
from scripts.comparison.rules import MAX_DEPTH, Columns, check_keys, is_shallow
from scripts.comparison.run_file import RunFile
from scripts.comparison.schema import (
    AGES,
    AGES_LEVELS,
    LATER,
    LEVELS,
    PAIRED,
    RECIPE,
    RUNS,
    SCHEMA,
    TABLES,
    settings,
)
from scripts.comparison.tables import Row, read_csv, write_checked
from scripts.names import RUNS as RUN_FILES
from scripts.options import AXES
from scripts.output import RECIPE as RECIPE_FILE
from scripts.output import check_whole, read_recipe_words
from slam.errors import LogFormatError


def write_table(path: Path, rows: Sequence[Mapping[str, Any]], axis: str = AXES[0]) -> None:
    """A table of a comparison, by its name; ``InvalidValueError`` for rows that it cannot have."""
    write_checked(path, rows, TABLES[path.name], axis)


@dataclass(frozen=True, eq=False)
class Compared:
    """The folder of a comparison; ``LogFormatError`` for what in it is not as ``schema`` says.

    vouched  the hashes of its files have been checked
    """

    folder: Path
    vouched: bool = False

    @cached_property
    def recipe(self) -> Row:
        """``recipe.json``."""
        path = self.folder / RECIPE_FILE
        recipe = check_recipe(path, RECIPE)
        told = recipe["settings"]
        if told.get("compare_schema") != SCHEMA:
            got = f"settings.compare_schema is {told.get('compare_schema')!r:.80}"
            raise LogFormatError(path, f"no comparison of schema {SCHEMA}: {got}")
        check_keys(path, "settings.", told, settings(axis_in(told, path)))
        check_keys(path, "settings.", told, {k: kind for k, kind in LATER.items() if k in told})
        for key in ("slams", "scenes", "levels", "seeds"):
            if len(set(told[key])) < len(told[key]):
                raise LogFormatError(path, f"settings.{key} must name each once, got {told[key]}")
        return recipe

    @property
    def settings(self) -> Row:
        """Those of the recipe."""
        found: Row = self.recipe["settings"]
        return found

    @cached_property
    def axis(self) -> str:
        """What the levels are of, of ``scripts.options.AXES`` or ``LEVEL``; rows say "dynamism"."""
        return axis_in(self.settings, self.folder / RECIPE_FILE)

    @cached_property
    def runs(self) -> list[Row]:
        """Rows of ``runs.csv``, empty as None: every SLAM in every scene, at every level and
        with every seed of the recipe, and no other.
        """
        rows = self._rows(RUNS)
        own = self.settings
        wanted = math.prod(len(own[name]) for name in ("scenes", "levels", "seeds", "slams"))
        if len(rows) != wanted:  # known and no two the same: as many as there are is all
            each = "one for each scene, level, seed and SLAM of the recipe"
            said = f"must have {wanted} rows, {each}, got {len(rows)}"
            raise LogFormatError(self.folder / RUNS, said)
        return rows

    @cached_property
    def levels(self) -> list[Row]:
        """Rows of ``levels.csv``."""
        return self._rows(LEVELS)

    @cached_property
    def paired(self) -> list[Row]:
        """Rows of ``paired.csv``; none of one SLAM alone."""
        return self._rows(PAIRED)

    @cached_property
    def ages(self) -> list[Row]:
        """Rows of ``ages.csv``, a building and SLAM each; none where no SLAM lived in any."""
        return self._if_there(AGES)

    @cached_property
    def ages_levels(self) -> list[Row]:
        """Rows of ``ages_levels.csv``, their summary; none where there is none."""
        return self._if_there(AGES_LEVELS)

    def _if_there(self, name: str) -> list[Row]:
        return self._rows(name) if self.settings.get("sessions") is not None else []

    def _rows(self, name: str) -> list[Row]:
        """Of a table, all of whose names are in the recipe."""
        path = self.folder / name
        rows = read_csv(path, TABLES[name], self.axis, vouched=self.vouched)
        if not rows and name != PAIRED:
            raise LogFormatError(path, "a table without rows")
        known = {column: {*self.settings[setting]} for column, setting in _NAMED.items()}
        for number, row in enumerate(rows, 1):
            for column, values in known.items():
                # Seeds of buildings are those of the runs; a building has no level.
                if column in row and row[column] not in values:
                    named = self.axis if column == "dynamism" else column
                    wanted = f"must be one of settings.{_NAMED[column]} of the recipe"
                    said = f"row {number}: column {named!r} {wanted}, got {row[column]!r:.80}"
                    raise LogFormatError(path, said)
        return rows

    def names(self) -> list[str]:
        """Of the files of ``runs/``, without their ending."""
        of = self.settings
        return [
            Run(scene=scene, dynamism=level, seed=seed, axis=self.axis).name
            for scene, level, seed in product(of["scenes"], of["levels"], of["seeds"])
        ]

    def run(self, scene: str, dynamism: float, seed: int) -> RunFile:
        """One simulated run with all SLAMs."""
        return self._file(Run(scene=scene, dynamism=dynamism, seed=seed, axis=self.axis).name)

    def _file(self, name: str) -> RunFile:
        path = self.folder / RUN_FILES / f"{name}.npz"
        return RunFile(path, self.settings["slams"], vouched=self.vouched)

    def check_tables(self) -> None:
        """Read all that is no run."""
        _ = self.runs, self.levels, self.paired, self.ages, self.ages_levels

    def check(self) -> None:
        """Read all that it has."""
        self.check_tables()
        for name in self.names():
            self._file(name)


# Columns whose words and numbers are among settings of the recipe.
_NAMED = {
    "scene": "scenes", "dynamism": "levels", "seed": "seeds", "slam": "slams", "slam_a": "slams",
    "slam_b": "slams",
}  # fmt: skip


def read(folder: Path, *, vouched: bool = False) -> Compared:
    """A comparison on file; ``LogFormatError`` for a folder that holds none, or half of one.

    vouched  as of ``Compared``
    """
    check_whole(folder)
    compared = Compared(folder, vouched)
    _ = compared.recipe
    return compared


def axis_in(told: Mapping[str, Any], path: Path) -> str:
    """What the levels are of by the settings in the recipe ``path``; before, always dynamism."""
    check_keys(path, "settings.", {"axis": AXES[0], **told}, {"axis": LATER["axis"]})
    return str(told.get("axis", AXES[0]))


def check_recipe(path: Path, kinds: Columns) -> Row:
    """The words of a recipe; ``LogFormatError`` for a key that is not there, or not of its kind."""
    recipe = read_recipe_words(path)
    if not is_shallow(recipe):  # what is nested deeper cannot even be shown
        raise LogFormatError(path, f"must be plain data, nested {MAX_DEPTH} deep at most")
    check_keys(path, "", recipe, kinds)
    return recipe
