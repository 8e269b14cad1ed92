# SPDX-License-Identifier: Apache-2.0
"""Named pipes, links and nested lists where files are expected: told, never waited for."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from scripts import results
from scripts.comparison.schema import RUNS, TABLES
from scripts.comparison.tables import read_csv
from scripts.output import read_recipe_words, write_recipe
from sim.recording.episode import record
from sim.recording.recipe import Recipe, read_recipe
from sim.recording.sums import SUMS, check_vouched, write_sums
from sim.recording.verify import check_hashes
from slam.errors import LogFormatError
from slam.logs.bag_topics import Bag

pytestmark = pytest.mark.fuzz


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Of some verb, whole."""
    write_recipe(tmp_path, "other", {})
    write_sums(tmp_path)
    return tmp_path


def piped(path: Path) -> Path:
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    return path


def nested(folder: Path) -> None:
    """A file that nobody lists, in a folder that claims to be a result."""
    folder.mkdir(parents=True)
    (folder / "strange.bin").write_bytes(b"x")
    (folder / SUMS).write_text("0" * 64 + "  other.bin\n")


@pytest.mark.parametrize(
    ("read", "name"),
    [
        (read_recipe, "recipe.json"),
        (read_recipe_words, "recipe.json"),
        (check_vouched, "recipe.json"),
        (lambda path: read_csv(path, TABLES[RUNS]), "runs.csv"),
        (Bag, "a.mcap"),
        (lambda path: Bag(path.parent), "a.mcap"),
    ],
)
def test_a_named_pipe_is_refused(read: Callable[[Path], object], name: str, folder: Path):
    with pytest.raises(LogFormatError, match="not a file"):
        read(piped(folder / name))


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (lambda folder: piped(folder / "recipe.json"), "incomplete"),
        (lambda folder: nested(folder / "a" / "b"), "foreign"),
        (lambda folder: nested(folder / ".a" / "b"), "foreign"),
        (lambda folder: (folder / "one").symlink_to("."), "foreign"),
    ],
)
def test_verify_tells_pipes_links_and_nested_lists(change, verdict: str, folder: Path):
    change(folder)
    assert [found.verdict for found in results.check(folder)] == [verdict]


@pytest.mark.parametrize("where", ["a", "a/b"])
def test_a_nested_list_hides_nothing_of_an_episode(where: str, tmp_path: Path):
    recipe = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1)
    record(recipe, tmp_path)
    episode = tmp_path / recipe.name
    assert check_hashes(episode).ok
    nested(episode / where)
    assert check_hashes(episode).verdict == "foreign"
