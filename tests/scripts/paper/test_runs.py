# SPDX-License-Identifier: Apache-2.0
"""Runs: what they depend on, what they keep, and the numbers over seeds."""

import math
from pathlib import Path

import numpy as np
import pytest

from scripts.jobs import _digest
from scripts.paper.runs import job, save_run, sign_test, spread, spread_text

pytestmark = pytest.mark.slow


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


def test_medians_and_sign_tests():
    assert spread([1.0, 2.0, 3.0, math.nan])[0] == 2.0
    assert spread_text([]) == "–"
    assert spread_text([1.0, math.nan, 2.0]) == "1.5 [1.25, 1.75] (2 of 3)"
    assert sign_test([1.0] * 17 + [3.0] * 3, [2.0] * 20) == (17, "17 : 3, p = 0.0026")
    assert sign_test([1.0], [1.0]) == (0, "0 : 0, p = 1")
    assert sign_test([math.nan, 1.0, math.nan], [1.0, math.nan, math.nan])[1][:5] == "1 : 1"
