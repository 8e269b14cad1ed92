# SPDX-License-Identifier: Apache-2.0
"""Whatever is done to a result, verify says so, and nobody reads something else from it."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import typer

from scripts import results
from scripts.output import write_recipe
from scripts.spec import command
from scripts.verbs.verify import Verify
from scripts.whole_folder import whole_folder
from sim.recording.dataset import read_plan, writing
from sim.recording.episode import record
from sim.recording.recipe import RECIPE
from sim.recording.sums import SUMS, add_to_sums, check_vouched, read_sums, write_sums
from sim.recording.verify import METADATA, check_bag
from slam import locks
from slam.errors import LogFormatError, OutputError
from tests.scripts.robustness.samples import (
    made,
    misread,
    missed_by_verify,
)

pytestmark = pytest.mark.fuzz
verify = command(Verify)

EPISODES = ["arena-d0.5-s0000", "arena-d0.5-s0001"]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    return made("dataset", tmp_path_factory.mktemp("made") / "data")


@pytest.fixture(scope="module")
def comparison(tmp_path_factory) -> Path:
    return made("comparison", tmp_path_factory.mktemp("made") / "compared")


@pytest.fixture
def copied(dataset, tmp_path) -> Path:
    return Path(shutil.copytree(dataset, tmp_path / "data"))


def verdicts(path: Path) -> set[str]:
    return {finding.verdict for finding in results.check(path) if finding.verdict != "whole"}


def status(path: Path) -> int:
    try:
        verify(path)
    except typer.Exit as left:
        return left.exit_code
    return 0


@pytest.mark.parametrize(
    ("name", "count"),
    [("dataset", 60), ("comparison", 24), ("map", 21), ("raster", 21), ("drive", 21)],
)
def test_every_damage_is_noticed_or_made_good(name, count, tmp_path, request):
    there = name in ("dataset", "comparison")
    folder = request.getfixturevalue(name) if there else made(name, tmp_path / name)
    assert missed_by_verify(name, folder, count, seed=1) == []
    assert misread(name, folder, 3, seed=3) == []


def append(name: str, text: str = "x") -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        path = folder / name
        path.write_text(path.read_text() + text if path.exists() else text)

    return change


def drop_line(sums: str, *names: str) -> Callable[[Path], object]:
    """The files and their lines."""

    def change(folder: Path) -> None:
        kept = {k: v for k, v in read_sums((folder / sums).parent).items() if k not in names}
        for name in names:
            ((folder / sums).parent / name).unlink()
        (folder / sums).write_text("".join(f"{v}  {k}\n" for k, v in kept.items()))

    return change


def relisted(folder: Path) -> None:
    """A changed map whose episode was given new hashes."""
    append(f"{EPISODES[0]}/map.yaml", "\n")(folder)
    write_sums(folder / EPISODES[0])


def swapped(folder: Path) -> None:
    """Whole episodes under each other's names."""
    one, other = (folder / name for name in EPISODES)
    one.rename(folder / "aside")
    other.rename(one)
    (folder / "aside").rename(other)


def linked(folder: Path) -> None:
    path = folder / EPISODES[1]
    path.rename(folder.parent / "elsewhere")
    path.symlink_to(folder.parent / "elsewhere")


def in_other_words(change: Callable[[str], str], name: str = SUMS) -> Callable[[Path], object]:
    def rewritten(folder: Path) -> None:
        (folder / name).write_text(change((folder / name).read_text()))

    return rewritten


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (append(f"{EPISODES[0]}/{METADATA}", " "), 1, "metadata.yaml is damaged"),
        (append("dataset.json", "\n"), 1, "dataset.json: damaged"),
        (append(SUMS, "\n"), 1, "SHA256SUMS:21: no hash"),
        (in_other_words(lambda text: text[:-1]), 1, "not as it was written"),
        (in_other_words(lambda text: text.replace("  a", " *a")), 1, "no hash and file name"),
        (in_other_words(lambda t: "\n".join(t.splitlines()[::-1]) + "\n"), 1, "not as it was"),
        (in_other_words(lambda t: t.replace('"seed": 0', '"seed": 1'), "dataset.json"), 1, "SUMS"),
        (drop_line(f"{EPISODES[0]}/{SUMS}", "map.pgm"), 1, "does not list map.pgm"),
        (relisted, 1, "is not what"),
        (swapped, 1, "not the recipe that is planned"),
        (lambda folder: shutil.rmtree(folder / EPISODES[1]), 3, f"{EPISODES[1]} is missing"),
        (lambda folder: (folder / EPISODES[0] / "map.pgm").unlink(), 3, "map.pgm is missing"),
        (lambda folder: (folder / EPISODES[0] / SUMS).unlink(), 3, "No such file"),
        (lambda folder: (folder / SUMS).unlink(), 3, "SHA256SUMS: cannot be read"),
        (linked, 3, "is no folder"),
        (append("notes.txt"), 4, "notes.txt is foreign"),
        (append(locks.LOCK), 4, ".lock is left of a run that was killed"),
        (lambda folder: (folder / ".a-d1.host.1.part").mkdir(), 4, "was killed"),
        (lambda folder: (folder / EPISODES[0] / "empty").mkdir(), 4, "empty is foreign"),
        (lambda folder: (folder / "l").symlink_to(folder / "dataset.json"), 4, "l is a link"),
        (lambda folder: shutil.copytree(folder / EPISODES[0], folder / "b"), 4, "b is foreign"),
    ],
)
def test_words_and_status_say_what_is_wrong(copied, capsys, change, code, words):
    change(copied)
    assert status(copied) == code
    printed = capsys.readouterr()
    assert words in (printed.out + printed.err).replace("\n", "")


def test_other_bytes_of_the_same_messages_are_no_excuse_for_the_rest(copied):
    from backports import zstd

    import sim.recording.bag as bag

    episode = copied / EPISODES[0]
    recipe = next(iter(read_plan(copied).planned().values()))
    options = dict(bag._OPTIONS)
    bag._OPTIONS[zstd.CompressionParameter.compression_level] = 5
    try:
        record(recipe, copied.parent)
    finally:
        bag._OPTIONS.update(options)
    packed = copied.parent / episode.name / f"{episode.name}.mcap"
    shutil.copy(packed, episode / packed.name)
    assert (verdicts(copied), status(copied)) == ({"same messages"}, 5)
    check_bag(episode)
    append("notes.txt")(copied)  # the worst counts
    assert status(copied) == 4
    (copied / EPISODES[1] / "map.yaml").unlink()
    assert status(copied) == 3
    append(f"{EPISODES[0]}/{METADATA}", "\n")(copied)
    assert status(copied) == 1
    with pytest.raises(LogFormatError, match="mcap: damaged"):
        check_bag(copied / EPISODES[1] / _with_a_flip(copied / EPISODES[1]))


def _with_a_flip(episode: Path) -> str:
    bag = next(episode.glob("*.mcap"))
    data = bytearray(bag.read_bytes())
    data[len(data) // 2] ^= 1
    bag.write_bytes(bytes(data))
    return bag.name


def test_generate_keeps_what_is_not_its_own(copied):
    append(f"{EPISODES[0]}/notes.txt", "mine")(copied)
    plan = read_plan(copied)
    with writing(copied, plan) as data:
        missing, notes = data.missing()
    assert (missing, len(notes)) == ([], 1)
    (copied / EPISODES[0] / "map.pgm").unlink()
    with pytest.raises(OutputError, match=r"notes\.txt"), writing(copied, plan) as data:
        data.missing()
    assert (copied / EPISODES[0] / "notes.txt").read_text() == "mine"


def test_the_sums_of_a_dataset_are_those_of_sha256sum(dataset):
    done = subprocess.run(["sha256sum", "-c", "--quiet", SUMS], cwd=dataset, check=False)
    assert done.returncode == 0
    listed = {path.relative_to(dataset).as_posix() for path in dataset.rglob("*")}
    assert set(read_sums(dataset)) == listed - {SUMS, *EPISODES}


def test_a_result_within_a_comparison_is_one_of_its_own(comparison, tmp_path):
    folder = Path(shutil.copytree(comparison, tmp_path / "compared"))
    with whole_folder(folder / "within", overwrite=False) as part:
        write_recipe(part, "other", {})
    assert [finding.verdict for finding in results.check(folder)] == ["whole", "whole"]
    append("within/recipe.json")(folder)
    assert status(folder) == 1


def test_a_damaged_list_does_not_let_a_changed_file_pass(tmp_path):
    """A line with another name is of no file, and its own file has no line: that is no leave."""
    with whole_folder(tmp_path / "run", overwrite=False) as part:
        for name in ("a.csv", "recipf.txt", "z.npz"):
            (part / name).write_text(name)
        write_recipe(part, "run", {"seed": 0})
    recipe, sums = tmp_path / "run" / RECIPE, tmp_path / "run" / SUMS
    check_vouched(recipe)
    recipe.write_text(recipe.read_text().replace("0", "1"))
    rng, whole = np.random.default_rng(7), sums.read_bytes()
    line = whole.index(b"recipe.json") - 66
    for k in range(300):
        data = bytearray(whole)
        at = int(rng.integers(line, line + 78)) if k % 2 else int(rng.integers(len(data)))
        data[at] ^= 1 << int(rng.integers(8))
        if k % 3 == 0:
            del data[at]
        sums.write_bytes(data)
        with pytest.raises(LogFormatError, match=r"damaged|no hash|not a text"):
            check_vouched(recipe)
    sums.write_bytes(whole.replace(b"recipe.json", b"recipe.jsoo"))
    with pytest.raises(LogFormatError, match=r"lists recipe.jsoo, which is not there, and not rec"):
        check_vouched(recipe)
    sums.write_bytes(whole)
    (tmp_path / "run" / "mine.txt").write_text("mine")
    check_vouched(tmp_path / "run" / "mine.txt")  # nobody lists it, and nothing is lost
    add_to_sums(recipe)
    check_vouched(recipe)


def test_one_episode_is_checked_and_made_again_by_any_name(copied, monkeypatch, capsys):
    (copied / EPISODES[0]).rename(copied / "mine")
    monkeypatch.chdir(copied / "mine")
    verify(Path(), regenerate=1)
    assert "same bytes mine" in capsys.readouterr().out
    Path("map.yaml").unlink()
    assert status(Path()) == 3


def test_names_in_a_list_cannot_lead_elsewhere_or_write_to_the_terminal(copied):
    for name in ("../x", "/etc/passwd", "a\x1b[2J"):
        (copied / SUMS).write_text(f"{'0' * 64}  {name}\n")
        with pytest.raises(LogFormatError, match="no hash and file name"):
            read_sums(copied)


def test_a_folder_of_nothing_of_ours_is_refused(tmp_path):
    (tmp_path / "photos").mkdir()
    for path in (tmp_path / "photos", tmp_path / "none"):
        with pytest.raises(LogFormatError, match=r"holds no|no such"):
            verify(path)


def test_a_map_is_called_well_when_it_or_its_folder_has_its_hashes(tmp_path):
    folder = made("raster", tmp_path / "raster")
    assert status(folder / "map.yaml") == status(folder / "map.pgm") == 0
    write_sums(folder)
    assert status(folder / "map.yaml") == 0
    (folder / SUMS).unlink()
    text = (folder / "map.yaml").read_text()
    (folder / "map.yaml").write_text("".join(text.splitlines(keepends=True)[2:]))
    assert status(folder / "map.yaml") == 3
