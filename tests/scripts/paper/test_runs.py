# SPDX-License-Identifier: Apache-2.0
"""Runs: what they depend on, what they keep, and the numbers over seeds."""

import math
from pathlib import Path

import numpy as np
import pytest

from scripts.jobs import _digest, run_jobs
from scripts.paper import park_runs, point_runs, rooms
from scripts.paper.runs import Plan, job, load_run, save_run, sign_test, spread
from slam.errors import InvalidValueError


def a_run(path: Path, *, seed: int, data: str) -> None:
    save_run(path, {"seed": seed, "θ": math.nan}, {"poses": np.eye(3)})


def test_a_run_is_made_again_when_its_data_change_and_not_when_their_folder_is_named_anew(
    tmp_path, monkeypatch
):
    file = tmp_path / "aa3_gpsx.mat"
    file.write_bytes(b"1")

    def name(data: str) -> str:
        _digest.cache_clear()
        return job("a", a_run, seed=1, data=data).file_name()

    before = name(str(tmp_path))
    monkeypatch.chdir(tmp_path.parent)
    assert name(f"./{tmp_path.name}") == before
    (tmp_path / "notes.md").write_text("mine")
    assert name(str(tmp_path)) == before
    file.write_bytes(b"2")
    assert name(str(tmp_path)) != before


def test_a_run_depends_on_what_makes_it_and_not_on_pages():
    def depends(call, **arguments) -> set[str]:
        return {path.name for path in job("a", call, **arguments).code}

    of_rooms = depends(rooms.run_one, scene="office")
    assert {"slam", "rooms.py", "runs.py", "sim", "scenes"} <= of_rooms
    assert not {"report.py", "room_pages.py"} & of_rooms
    assert {"slam", "point_runs.py", "census.py"} <= depends(point_runs.run_one)
    for runs in (point_runs, park_runs):
        made_of = depends(runs.run_one)
        assert not {"sim", "landmarks.py", "victoria_park.py", "report.py"} & made_of


def test_runs_come_back_as_they_were(tmp_path):
    (made,) = run_jobs([job("a", a_run, seed=7, data=str(tmp_path))], tmp_path).values()
    run = load_run(made)
    assert run.numbers["seed"] == 7
    assert math.isnan(run.numbers["θ"])
    assert list(run.arrays) == ["poses"]
    np.testing.assert_array_equal(run.arrays["poses"], np.eye(3))


def test_medians_and_sign_tests():
    assert spread([1.0, 2.0, 3.0, math.nan]).median == 2.0
    assert spread([]).text() == "–"
    assert spread([1.0, math.nan, 2.0]).text() == "1.5 [1.25, 1.75] (2 of 3)"
    test = sign_test([1.0] * 17 + [3.0] * 3, [2.0] * 20)
    assert (test.wins, test.losses) == (17, 3)
    np.testing.assert_allclose(test.p, 0.00258, rtol=0.01)
    assert sign_test([1.0], [1.0]).p == 1.0
    lost = sign_test([math.nan, 1.0, math.nan], [1.0, math.nan, math.nan])
    assert (lost.wins, lost.losses) == (1, 1)


def test_seeds_are_those_nobody_tuned_on(tmp_path):
    assert Plan(out=tmp_path).seed_list() == list(range(200, 220))
    assert Plan(out=tmp_path, quick=True).seed_list() == [200]
    assert Plan(out=tmp_path, quick=True, seeds=3).seed_list() == [200, 201, 202]
    with pytest.raises(InvalidValueError, match="--seeds must be >= 1, got 0"):
        Plan(out=tmp_path, seeds=0)
