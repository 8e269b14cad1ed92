# SPDX-License-Identifier: Apache-2.0
"""The table of what each part of the SLAM is worth."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.benchmark.tracks import TRACKS
from scripts.experiments import ablation
from slam.errors import InvalidValueError
from slam.system import create
from slam.variants import named

NAMES = [named("shunting", changes) for changes in ablation.PARTS.values()]


def result(track: str, slam: str, drift: float, *, lost: bool = False) -> ablation.Result:
    run = ablation.Run(track=track, slam=slam, recording=Path("x.npz"))
    return ablation.Result(run=run, drift=drift, lost=lost)


@pytest.mark.parametrize("name", NAMES)
def test_every_part_can_be_taken_out(name: str) -> None:
    assert create(name) is not None


def test_cells_are_geometric_means_and_losses_are_counted() -> None:
    tracks = ["tour-guide-v1", "no-walls-v1"]
    rows = [
        result(track, slam, drift, lost=drift > 0.03)
        for track in tracks
        for slam in (*NAMES, TRACKS[track].oracle)
        for drift in ((0.01, 0.04) if track == tracks[0] else (0.01,))
    ]
    head, _, whole, *_, oracle = ablation.table(rows).splitlines()
    assert head == "| taken out | tour-guide-v1 | no-walls-v1 | all |"
    assert whole == "| whole | 2.00, 1 of 2 | 1.00, 0 of 1 | 1.41 |"
    assert oracle == "| oracle | 2.00, 1 of 2 | 1.00, 0 of 1 | 1.41 |"


def test_a_folder_without_recordings_is_told(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="holds no recordings"):
        ablation.runs(tmp_path, ["tour-guide"], (1.0,), 2)
