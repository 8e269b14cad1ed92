# SPDX-License-Identifier: Apache-2.0
"""Predictions come first; ranks of the twins against ranks of the logs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scripts.experiments import reality
from slam.errors import InvalidValueError

TWIN = {"shunting": 0.01, "karto": 0.05, "ekf": 0.5, "odometry": 5.0}
LOG = {"shunting": 0.10, "karto": 0.08, "ekf": 0.4, "odometry": 9.0}


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    found = tmp_path / "predicted.json", tmp_path / "real.json"
    monkeypatch.setattr(reality, "PREDICTED", found[0])
    monkeypatch.setattr(reality, "REAL", found[1])
    monkeypatch.setattr(reality, "AFTER", tmp_path / "after.json")
    return found


def test_nothing_is_predicted_once_it_is_known(files: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="predict first"):
        reality.real(tmp_path, ("intel",), ("odometry",))
    files[1].write_text('{"intel": {"odometry": 1.0}}')
    with pytest.raises(InvalidValueError, match="a prediction comes before"):
        reality.predict(tmp_path, ("intel",), ("odometry",))


def test_the_table_sets_ranks_beside_ranks(files: tuple[Path, Path]) -> None:
    predicted = {name: {"0": value} for name, value in TWIN.items()}
    files[0].write_text(json.dumps({log: {"errors_m": predicted} for log in ("intel", "fhw")}))
    files[1].write_text(json.dumps({"intel": LOG, "fhw": TWIN}))
    lines = reality.tables()
    assert lines[2].startswith("| intel | 0.01 / 0.1 |")
    assert lines[2].endswith("| +0.80 |")
    assert lines[3].endswith("| +1.00 |")
    assert any("+0.90 (95 %: +0.80 to +1.00)" in line for line in lines)
