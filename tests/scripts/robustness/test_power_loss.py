# SPDX-License-Identifier: Apache-2.0
"""The power fails at any step: each thing is whole or absent, and the same command goes on."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from scripts.console import console
from scripts.robustness.disk_log import Cut, DiskLog, tree
from scripts.robustness.power_cases import all_together, cases, each_alone
from scripts.robustness.power_cuts import Case, tried
from slam.files import put, write_text

CASES = {case.name: case for case in cases(film=False)}
RESUMES = dict.fromkeys(CASES, 2) | {"run": 1}


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    console.quiet = True
    yield
    console.quiet = False


@pytest.mark.parametrize("name", [n for n in CASES if not n.startswith("run --")])
def test_whole_or_absent_and_it_goes_on(name, tmp_path):
    outcome = tried(CASES[name], tmp_path, resumes=RESUMES[name])
    assert outcome.torn == []
    assert outcome.other == []
    assert outcome.resumed == RESUMES[name]
    assert outcome.found["whole"] > 0
    had = CASES[name].first is not None
    assert (outcome.found["as before"] > 0) == had
    if had and name != "compare, a SLAM more":  # there some files are new
        assert outcome.found["absent"] == 0


def a_folder(text: str):
    def call(root):
        from scripts.output import whole_folder, write_recipe

        with whole_folder(root / "run", overwrite=True) as part:
            write_text(part / "a.txt", text)
            write_recipe(part, "test", {})

    return call


@pytest.mark.parametrize("exchange", [True, False])
def test_an_earlier_folder_is_never_lost(tmp_path, exchange):
    case = Case(
        name="folder", call=a_folder("new"), first=a_folder("old"), things=all_together,
        exact=True, exchange=exchange,
    )  # fmt: skip
    outcome = tried(case, tmp_path, resumes=30, draws=10)
    assert outcome.torn == []
    assert outcome.other == []
    assert outcome.found["absent"] == 0
    assert (outcome.found["on its way"] > 0) == (not exchange)


def test_without_syncing_it_would_be_torn(tmp_path, monkeypatch):
    """The test can fail: what is not synced is lost with its bytes, though it has its name."""
    monkeypatch.setattr("slam.files.sync", lambda path: None)
    outcome = tried(CASES["map, npz"], tmp_path, resumes=0)
    assert any("all names, no bytes" in line for line in outcome.torn)


def test_a_name_without_its_folder_synced_may_be_gone(tmp_path):
    def call(root):
        (root / "a.part").write_bytes(b"bytes")
        put(root / "a.part", root / "a")

    log = DiskLog(tmp_path)
    with log.recording():
        call(tmp_path)
    kinds = [type(step).__name__ for step in log.steps]
    assert kinds == ["Names", "Synced", "Names", "Synced"]
    assert log.left(3, Cut.NOTHING) == {}
    assert log.left(3, Cut.NAMES) == {"a": b"bytes"}
    assert log.left(1, Cut.NAMES) == {"a.part": b""}
    assert log.left(4, Cut.NOTHING) == tree(tmp_path) == {"a": b"bytes"}


def test_finished_things_are_synced_once(tmp_path, monkeypatch):
    """Files of a folder with it, a single file and its folder's names once each."""
    seen: list[str] = []
    fsync = os.fsync

    def counted(number):
        seen.append(os.readlink(f"/proc/self/fd/{number}").removeprefix(f"{tmp_path}/"))
        fsync(number)

    monkeypatch.setattr(os, "fsync", counted)
    a_folder("text")(tmp_path)
    part = f".run.{os.getpid()}.part"
    whole = ["a.txt", "recipe.json", "SHA256SUMS"]
    assert sorted(seen) == sorted([*(f"{part}/{name}" for name in whole), part, str(tmp_path)])
    seen.clear()
    write_text(tmp_path / "b.txt", "text")
    assert seen == [f".b.{os.getpid()}.part.txt", str(tmp_path)]
    assert each_alone(["b.txt"]) == {"b.txt": {"b.txt"}}
