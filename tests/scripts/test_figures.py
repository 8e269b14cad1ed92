# SPDX-License-Identifier: Apache-2.0
"""Figures look the same whatever was drawn before."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np

from scripts import figures
from slam.trajectory import Trajectory


def test_a_figure_is_the_same_to_the_byte_whoever_drew_before(tmp_path):
    turn = np.linspace(0.0, 6.0, 50)
    poses = np.stack([np.cos(turn), np.sin(turn), turn], axis=1)
    track = Trajectory(stamps_ns=np.arange(50) * 100_000_000, poses=poses)
    before = dict(mpl.rcParams)
    figures.errors(tmp_path / "one.png", {"shunting": track}, track)
    assert dict(mpl.rcParams) == before
    with mpl.rc_context({"font.size": 30, "axes.grid": False}):
        figures.errors(tmp_path / "two.png", {"shunting": track}, track)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
