# SPDX-License-Identifier: Apache-2.0
"""Output folders appear whole or not at all, and nobody's files are ever replaced."""

import json
import os
from pathlib import Path

import pytest

from scripts.comparison import folder as compared
from scripts.comparison.again import run_of
from scripts.names import run_name
from scripts.output import (
    READY,
    check_whole,
    locked_folder,
    result_folder,
    together,
    write_recipe,
)
from scripts.whole_folder import whole_folder
from sim.recording.dataset import PLAN
from sim.recording.sums import SUMS, write_sums
from slam.errors import LogFormatError, OutputError
from slam.files import write_text


def make(path: Path, text: str, *, overwrite: bool = False) -> None:
    made = {"command": "test", "settings": {"text": text}}
    with whole_folder(path, overwrite=overwrite, **made) as folder:
        (folder / "data.txt").write_text(text)
        write_recipe(folder, "test", {"text": text})


def test_an_earlier_run_is_refused_and_replaced_only_when_asked(tmp_path: Path):
    make(tmp_path / "run", "one")
    with pytest.raises(OutputError, match="earlier run of the same settings: pass --overwrite"):
        make(tmp_path / "run", "one")
    make(tmp_path / "run", "two", overwrite=True)
    assert (tmp_path / "run" / "data.txt").read_text() == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_to_overwrite_is_no_advice_for_another_result(tmp_path: Path):
    make(tmp_path / "run", "one")
    recipe = tmp_path / "run" / "recipe.json"
    with pytest.raises(OutputError, match=r"'one' there, 'two' now.*--out") as other:
        make(tmp_path / "run", "two")
    with (
        pytest.raises(OutputError, match="mobilia test wrote: choose another --out") as elsewhere,
        whole_folder(tmp_path / "run", overwrite=False, command="run", settings={"text": "one"}),
    ):
        pass
    with (
        pytest.raises(OutputError, match="mobilia test wrote: choose another --out") as grown,
        locked_folder(tmp_path / "run", "compare"),
    ):
        pass
    make(tmp_path / "run", "two", overwrite=True)  # who asks for it gets it
    recipe.write_text("{")
    for overwrite in (False, True):
        with pytest.raises(OutputError, match="cannot be read: choose another --out") as broken:
            make(tmp_path / "run", "two", overwrite=overwrite)
    assert not any("--overwrite" in str(error.value) for error in (other, elsewhere, grown, broken))


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("office-d0.5-s0001/", "office-d0.5-s0001"),
        ("one/office-d0.5-s0001/", "one-office-d0.5-s0001"),  # of a dataset
        ("intel.log.xz", "intel"),
        ("runs/arena-d0.5-s0100.npz", "arena-d0.5-s0100"),
        ("lab.v2.bag", "lab.v2"),
        ("recorded.mcap", "recorded"),
    ],
)
def test_outputs_keep_the_whole_name_of_an_episode(words, name, tmp_path: Path):
    if words.endswith("/"):
        (tmp_path / words).mkdir(parents=True)
    write_text(tmp_path / "one" / PLAN, "{}")
    assert run_name(tmp_path / words) == name


def test_somebody_elses_files_are_never_replaced(tmp_path: Path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.jpg").write_text("cat")
    with pytest.raises(OutputError, match="did not write"):
        make(tmp_path / "photos", "one", overwrite=True)
    assert (tmp_path / "photos" / "cat.jpg").read_text() == "cat"


@pytest.mark.parametrize("words", ['{"name": "tiramisu"}', "[]", "{", '{"command": "run"}', "\0"])
@pytest.mark.parametrize("vouched", [False, True])
def test_a_recipe_of_somebody_else_is_none_of_ours(tmp_path: Path, words: str, vouched: bool):
    theirs = tmp_path / "cake"
    write_text(theirs / "recipe.json", words)
    write_text(theirs / "src" / "main.c", "int main() {}")
    if vouched:
        write_sums(theirs)
    before = contents(theirs)
    for overwrite in (False, True):
        with pytest.raises(OutputError, match=r"choose another --out"):
            make(theirs, "one", overwrite=overwrite)
    with pytest.raises(OutputError, match=r"choose another --out"), locked_folder(theirs, "test"):
        raise AssertionError("it is locked")
    assert contents(theirs) == before
    assert [path.name for path in tmp_path.iterdir()] == ["cake"]


@pytest.mark.parametrize("swaps", [True, False])
@pytest.mark.parametrize("doubles", [True, False])
def test_what_is_not_ours_stays_when_a_run_is_replaced(
    tmp_path: Path, monkeypatch, capsys, swaps: bool, doubles: bool
):
    if not swaps:
        monkeypatch.setattr("slam.files.exchange", lambda one, other: False)
    if not doubles:
        monkeypatch.setattr("os.link", refuse)
    run = tmp_path / "run"
    make(run, "one")
    theirs = {"notes.md": "mine", "src/main.c": "int main() {}", ".hidden": "mine too"}
    for name, text in theirs.items():
        write_text(run / name, text)
    (run / "link").symlink_to(tmp_path)
    (run / "empty").mkdir()
    make(run / "within", "a result in the result")
    make(run, "two", overwrite=True)
    within = {f"within/{name}": text for name, text in contents(run / "within").items()}
    own = {name: contents(run)[name] for name in ("data.txt", "recipe.json")}
    assert contents(run) == own | theirs | within
    assert own["data.txt"] == "two"
    assert (run / "within" / "data.txt").read_text() == "a result in the result"
    assert (run / "link").readlink() == tmp_path
    assert (run / "empty").is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    told = capsys.readouterr().out
    assert f"note: {run}: kept what mobilia did not write: .hidden, empty, link, " in told
    assert told.count("\n") == 1
    make(run, "three", overwrite=True)
    assert set(contents(run)) == {*own, *theirs, *within}


def refuse(*_words: object, **_more: object) -> None:
    raise OSError(95, "Operation not supported")


def test_what_of_theirs_bears_a_name_of_ours_is_kept_under_another(tmp_path: Path, capsys):
    run = tmp_path / "run"
    make(run, "one")
    for name in ("data.txt", "data.txt.old"):
        write_text(run / name, f"my {name}")
    (run / SUMS).write_text("".join(
        line for line in (run / SUMS).read_text().splitlines(True) if "data" not in line
    ))  # fmt: skip
    make(run, "two", overwrite=True)
    assert "write: data.txt.old, data.txt.old.old" in capsys.readouterr().out
    (run / "data.txt").unlink()
    write_text(run / "data.txt/a/b", "in my folder")
    make(run, "three", overwrite=True)
    assert contents(run) == {
        "data.txt": "three", "data.txt.old": "my data.txt", "data.txt.old.old": "my data.txt.old",
        "data.txt.old.old.old/a/b": "in my folder",
        "recipe.json": (run / "recipe.json").read_text(),
    }  # fmt: skip


@pytest.mark.parametrize("list_", [None, "", "0" * 64 + "  ../x\n", "no list"])
def test_a_result_without_its_list_is_not_replaced(tmp_path: Path, list_: str | None):
    make(tmp_path / "run", "one")
    (tmp_path / "run" / SUMS).unlink()
    if list_ is not None:
        (tmp_path / "run" / SUMS).write_text(list_)
    before = contents(tmp_path / "run")
    with pytest.raises(OutputError, match="choose another --out"):
        make(tmp_path / "run", "two", overwrite=True)
    assert contents(tmp_path / "run") == before


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


def tables(folder: Path, text: str) -> None:
    with together(folder) as staged:
        for name in ("a.csv", "runs/b.csv"):
            write_text(staged / name, text)


def contents(folder: Path) -> dict[str, str]:
    return {
        file.relative_to(folder).as_posix(): file.read_text()
        for file in folder.rglob("*")
        if file.is_file() and file.name != SUMS
    }


def test_tables_appear_together_or_not_at_all(tmp_path: Path):
    tables(tmp_path, "old")
    (tmp_path / "mine.txt").write_text("mine")

    def half_of_them() -> None:
        with together(tmp_path) as staged:
            write_text(staged / "a.csv", "new")
            raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=f"cannot write {tmp_path}: No space left on device"):
        half_of_them()
    assert contents(tmp_path) == {"a.csv": "old", "runs/b.csv": "old", "mine.txt": "mine"}
    tables(tmp_path, "new")
    assert contents(tmp_path) == {"a.csv": "new", "runs/b.csv": "new", "mine.txt": "mine"}


@pytest.mark.parametrize("moved", range(4))
def test_tables_stopped_on_the_way_are_refused_until_the_same_command_goes_on(
    tmp_path: Path, monkeypatch, moved: int
):
    def grown(text: str) -> None:
        out = result_folder(tmp_path / "out", "compare", {"text": text})
        with out as tables, tables() as staged:
            for name in ("a.csv", "runs/b.csv"):
                write_text(staged / name, text)

    def cut(one, two):
        if Path(one).is_relative_to(tmp_path / "out" / READY):
            done.append(one)
            if len(done) > moved:
                raise KeyboardInterrupt
        replace(one, two)

    done, replace = list[Path](), os.replace
    grown("old")
    monkeypatch.setattr("os.replace", cut)
    with pytest.raises(KeyboardInterrupt):
        grown("new")
    monkeypatch.undo()
    for reader in (check_whole, compared.read, lambda out: run_of(out / "runs" / "b.npz")):
        with pytest.raises(LogFormatError, match=r"unfinished, .*: the same command again goes on"):
            reader(tmp_path / "out")
    grown("new")
    check_whole(tmp_path / "out")
    assert set(contents(tmp_path / "out")) == {"a.csv", "runs/b.csv", "recipe.json"}
    assert contents(tmp_path / "out")["a.csv"] == contents(tmp_path / "out")["runs/b.csv"] == "new"


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_no_lock(tmp_path: Path, failure: BaseException):
    def failing(out: Path) -> None:
        with locked_folder(out, "test"):
            raise failure

    with pytest.raises((OutputError, KeyboardInterrupt)) as caught:
        failing(tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []
    if isinstance(failure, OSError):
        said = f"cannot write {tmp_path / 'deep' / 'out'}: No space left on device"
        assert str(caught.value) == said
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".recipe.17.part.json").write_text("left by a cut")
    with (
        locked_folder(tmp_path / "out", "test"),
        pytest.raises(OutputError, match="another process"),
    ):
        failing(tmp_path / "out")


def test_what_killed_runs_left_is_removed(tmp_path: Path):
    (tmp_path / ".run.17.part").mkdir()
    (tmp_path / ".run.17.part" / "half").touch()
    (tmp_path / ".run2.17.part").mkdir()
    make(tmp_path / "run", "two")
    assert sorted(p.name for p in tmp_path.iterdir()) == [".run2.17.part", "run"]
