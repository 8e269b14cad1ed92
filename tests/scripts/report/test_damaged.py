# SPDX-License-Identifier: Apache-2.0
"""A comparison that somebody harmed is shown or refused in a line, and ``verify`` agrees."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scripts import results
from scripts.comparison.folder import read, write_table
from scripts.comparison.plan import Plan
from scripts.report import pictures
from scripts.report.study import study
from sim.recording.sums import write_sums
from slam.errors import InvalidValueError, LogFormatError
from tests.scripts.report import made

pytestmark = pytest.mark.film


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One seed at two levels, with buildings."""
    folder = made.make(tmp_path_factory.mktemp("damaged") / "compare", seeds=(100,))
    made.add_days(folder, buildings=1)
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "compare"))


def read_all(folder: Path) -> None:
    """All that a report of it could read."""
    study(folder).compared.check()


def well(folder: Path) -> bool:
    """Whether ``verify`` calls it well, all hashes being right."""
    write_sums(folder)
    return all(found.ok for found in results.check(folder))


def refusal(folder: Path) -> str:
    """What is said of it; "" where all is read."""
    try:
        read_all(folder)
    except LogFormatError as error:
        said = str(error)
    else:
        return ""
    assert str(folder) in said
    assert said.isprintable()
    assert len(said) < 4000
    return said


def test_what_is_whole_is_read_and_called_well(folder: Path):
    assert refusal(folder) == ""
    assert well(folder)


def array(name: str, value: Any):
    def harm(folder: Path) -> None:
        path = folder / "runs" / "room_d1_s100.npz"
        with np.load(path) as file:
            arrays = dict(file)
        arrays[name] = value(arrays[name]) if callable(value) else np.array(value)
        np.savez(path, **arrays)

    return harm


def cell(table: str, column: str, word: str):
    def harm(folder: Path) -> None:
        lines = [line.split(",") for line in (folder / table).read_text().splitlines()]
        lines[1][lines[0].index(column)] = word
        (folder / table).write_text("".join(",".join(line) + "\n" for line in lines))

    return harm


def setting(key: str, value: Any):
    def harm(folder: Path) -> None:
        words = json.loads((folder / "recipe.json").read_text())
        words["settings"][key] = value
        (folder / "recipe.json").write_text(json.dumps(words))

    return harm


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (array("static_map_resolution_m", 0.0),
         "array 'static_map_resolution_m' must lie in 0.001..1000, got 0.0"),
        (array("truth", lambda a: a[:, :2]), "array 'truth' must have shape (20 scans, 3), got "),
        (array("hit", lambda a: a + 9), "array 'hit' must lie in -2..1, got 9"),
        (array("moving", lambda a: a * 1.0), "array 'moving' must hold booleans, got float64"),
        (array("slams", np.array(["ekf", "ekf", "own"])), "array 'slams' must name each once"),
        (array("slam1_stamps_ns", lambda a: a + 1), "must begin as 'stamps_ns' does"),
        (array("stamps_ns", lambda a: a[::-1]), "array 'stamps_ns' must strictly increase"),
        (cell("runs.csv", "seed", "nan"),
         "runs.csv:2: seed must be a whole number from 0 to 9.22337e+18, got 'nan'"),
        (cell("runs.csv", "ate_unaligned_m", "1e300"), "must be at most 1e+100 or infinite, got"),
        (cell("runs.csv", "outcome", "well"), "outcome must be one of bad, finished, hung, lost,"),
        (cell("runs.csv", "slam", "karto"),
         "row 1: column 'slam' must be one of settings.slams of the recipe, got 'karto'"),
        (cell("levels.csv", "value", "2"), "value must be a number from 0 to 1, as it is of a sh"),
        (cell("ages.csv", "found", "9"), "found must be at most to_find, 4, got 9"),
        (setting("machine", ["processor"]), "settings.machine must be a table, got ['processor']"),
        (setting("slams", "shunting"), "settings.slams must be a list of 1 or more values"),
    ],
)  # fmt: skip
def test_one_wrong_value_is_named_with_what_is_wanted(folder: Path, harm, says: str):
    harm(folder)
    assert says in refusal(folder)
    assert not well(folder)


def test_a_run_without_movers_is_read_in_full_shape(folder: Path):
    """An array without entries is written without its type and inner lengths."""
    array("hit", lambda a: a * 0 - 1)(folder)
    for name in ("names", "kinds", "radii_m", "closed"):
        array(name, [])(folder)
    array("moving", lambda a: a[:, :0])(folder)
    array("mover_poses", lambda a: a[:, :0])(folder)
    run = read(folder).run(made.SCENE, 1.0, 100)
    assert (run.mover_poses.shape, run.moving.shape) == ((20, 0, 3), (20, 0))
    assert (run.names, run.kinds, run.moving.dtype) == ([], [], bool)
    assert pictures.moving_share(run).tolist() == [0.0] * 20


def test_what_cannot_be_read_is_not_written(tmp_path: Path):
    row = {**made.row_of(made.OURS, 0.0, 100), "lost": 2}
    with pytest.raises(InvalidValueError, match="row 1: lost must be a whole number from 0 to 1,"):
        write_table(tmp_path / "runs.csv", [row])
    with pytest.raises(InvalidValueError, match=r"Plan\.seeds\[0\] must be a whole number"):
        Plan(slams=("ekf",), scenes=("arena",), levels=(0.0,), seeds=(10**30,))
    assert not (tmp_path / "runs.csv").exists()
