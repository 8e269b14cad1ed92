# SPDX-License-Identifier: Apache-2.0
"""What ``scripts.robustness.kills`` takes for torn, different and left behind."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from scripts.robustness import kills


@pytest.fixture
def comparison(tmp_path) -> Path:
    out = tmp_path / "whole"
    (out / "runs").mkdir(parents=True)
    (out / "runs.csv").write_text("slam,ate_m,ms_per_scan_p50\nodometry,0.1,3.0\n")
    np.savez(out / "runs" / "a.npz", poses=np.array([1.0, np.nan]), slam0_milliseconds=np.ones(1))
    return out


def test_a_comparison_differs_by_its_numbers_not_by_its_timings(comparison, tmp_path):
    other = Path(shutil.copytree(comparison, tmp_path / "other"))
    (other / "runs.csv").write_text("slam,ate_m,ms_per_scan_p50\nodometry,0.1,4.0\n")
    changed = {"poses": np.array([1.0, np.nan]), "slam0_milliseconds": np.zeros(1)}
    np.savez(other / "runs" / "a.npz", **changed)
    assert kills.same_numbers(comparison, other)
    assert not kills.same_bytes(comparison, other)
    np.savez(other / "runs" / "a.npz", **changed | {"poses": np.array([2.0, np.nan])})
    assert not kills.same_numbers(comparison, other)


def test_a_hidden_file_is_a_difference_and_half_an_archive_is_torn(comparison, tmp_path):
    other = Path(shutil.copytree(comparison, tmp_path / "other"))
    assert kills.same_bytes(comparison, other)
    assert kills.torn_archives(other) == []
    (other / ".lock").touch()
    assert not kills.same_numbers(comparison, other)
    archive = other / "runs" / "a.npz"
    archive.write_bytes(archive.read_bytes()[:100])
    assert kills.torn_archives(other) == ["a.npz"]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_waits_for_the_last_process_of_a_command():
    sleeper = subprocess.Popen(
        ["sleep", "300"], env={**os.environ, kills.MARK: "test"}, start_new_session=True
    )
    with sleeper:
        until = time.monotonic() + 10.0  # the kernel shows an environment shortly after the start
        while sleeper.pid not in kills.marked("test") and time.monotonic() < until:
            time.sleep(0.01)
        killer = threading.Timer(0.2, sleeper.kill)
        killer.start()
        assert 0.0 < kills.last_end_s("test") < kills.WAIT_S
        killer.join()
