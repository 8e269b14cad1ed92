# SPDX-License-Identifier: Apache-2.0
"""Figures look the same whatever was drawn before."""

import matplotlib as mpl
import numpy as np

from scripts import figures
from slam.estimate import Changes, Raster
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


def test_a_picture_of_changes_is_there_only_where_something_changed(tmp_path):
    cells = np.zeros((30, 40))
    cells[10:13, 20:22] = 1.0
    still, gone = (
        Raster(values=values, resolution_m=0.1, T_map_origin=np.array([-1.0, -1.0, 0.0]))
        for values in (np.zeros((30, 40)), cells)
    )
    track = Trajectory(stamps_ns=np.array([0, 1]), poses=np.array([[0.0, 0, 0], [1.0, 0.5, 0]]))
    path = tmp_path / "changes.png"
    figures.changes_picture(path, gone, Changes(appeared=still, gone=still), track)
    assert not path.exists()
    figures.changes_picture(path, gone, Changes(appeared=still, gone=gone), track)
    assert path.stat().st_size > 10_000
