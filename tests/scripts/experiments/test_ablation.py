# SPDX-License-Identifier: Apache-2.0
"""The ablation: its cells, what is run on which track, and what is refused."""

import pytest

from scripts.benchmark.tracks import TRACKS
from scripts.experiments import ablation

pytestmark = pytest.mark.slow
TRACKS_OF = ("tour-guide-v1", "no-walls-v1")


def test_cells_of_tracks_are_geometric_means_and_losses_are_counted():
    rows = [
        {"track": track, "slam": slam, "rpe_m_per_m": drift, "lost": int(drift > 0.03),
         "outcome": "finished", "seed": 0}
        for track in TRACKS_OF
        for slam in ("shunting", TRACKS[track].oracle)
        for drift in ((0.01, 0.04) if track == TRACKS_OF[0] else (0.01,))
    ]  # fmt: skip
    head, _, whole, oracle, _ = ablation.markdown(rows).splitlines()
    assert head == "| slam | tour-guide-v1 | no-walls-v1 | all |"
    assert whole == "| shunting | 2.00, 1 of 2 | 1.00, 0 of 1 | 1.41 |"
    assert oracle == "| oracle(shunting) | 2.00, 1 of 2 | – | 2.00 |"


def test_only_the_oracle_of_a_track_runs_there():
    slams = ("shunting", "oracle(shunting)", "oracle(shunting,moving)")
    assert [ablation.fitting(slams, TRACKS[name]) for name in TRACKS_OF] == [slams[:2], slams[::2]]
