# SPDX-License-Identifier: Apache-2.0
"""Output folders appear whole or not at all, and nobody's files are ever replaced."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scripts.output import whole_folder, write_recipe
from slam.errors import OutputError


def make(path: Path, text: str, *, overwrite: bool = False) -> None:
    with whole_folder(path, overwrite=overwrite) as folder:
        (folder / "data.txt").write_text(text)
        write_recipe(folder, "test", {"text": text})


def test_a_folder_appears_whole(tmp_path: Path):
    make(tmp_path / "run", "one")
    assert (tmp_path / "run" / "data.txt").read_text() == "one"
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_an_earlier_run_is_refused_and_replaced_only_when_asked(tmp_path: Path):
    make(tmp_path / "run", "one")
    with pytest.raises(OutputError, match="holds an earlier run: pass --overwrite"):
        make(tmp_path / "run", "two")
    make(tmp_path / "run", "two", overwrite=True)
    assert (tmp_path / "run" / "data.txt").read_text() == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_somebody_elses_files_are_never_replaced(tmp_path: Path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.jpg").write_text("cat")
    with pytest.raises(OutputError, match="did not write"):
        make(tmp_path / "photos", "one", overwrite=True)
    assert (tmp_path / "photos" / "cat.jpg").read_text() == "cat"


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError])
def test_a_failure_leaves_nothing_and_keeps_the_earlier_run(tmp_path: Path, failure: type):
    make(tmp_path / "run", "one")

    def half_a_run() -> None:
        with whole_folder(tmp_path / "run", overwrite=True) as folder:
            (folder / "data.txt").write_text("half")
            raise failure

    with pytest.raises(failure):
        half_a_run()
    assert (tmp_path / "run" / "data.txt").read_text() == "one"
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_a_file_in_the_way_and_an_unwritable_parent_are_named(tmp_path: Path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"):
        make(tmp_path / "file", "one")
    with pytest.raises(OutputError, match="cannot write"):
        make(tmp_path / "file" / "below", "one")


def test_a_recipe_is_strict_json(tmp_path: Path):
    with whole_folder(tmp_path / "run", overwrite=False) as folder:
        write_recipe(folder, "test", {"rates": {"stay": float("inf")}, "sizes": (1, 2.5)})
    recipe = json.loads((tmp_path / "run" / "recipe.json").read_text(), parse_constant=pytest.fail)
    assert recipe["settings"] == {"rates": {"stay": "inf"}, "sizes": [1, 2.5]}
