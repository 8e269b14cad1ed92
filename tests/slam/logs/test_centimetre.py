# SPDX-License-Identifier: Apache-2.0
"""Plain L/O logs in centimetres."""

import math

import numpy as np
import pytest

from slam import se2
from slam.errors import LogFormatError
from slam.logs import open_log, read_centimetre


def lines(n=6, beams=180):
    """Rows of a log: a robot ahead at 10 cm a scan, its laser 25 cm ahead of it."""
    out = []
    for k in range(n):
        pose = np.array([0.1 * k, 0.0, 0.1])
        laser = se2.compose(pose, [0.25, 0.0, 0.0])
        words = [f"{100 * v:.4f}" for v in (*pose[:2],)] + ["0.1"]
        there = [f"{100 * v:.4f}" for v in laser[:2]] + ["0.1"]
        ranges = [str(100 + (7 * i + k) % 90) for i in range(beams)]
        out.append(f"O {' '.join(words)} {0.2 * k:.6f}\n")
        out.append(f"L {' '.join([*words, *there, *ranges])} {0.2 * k + 0.01:.6f}\n")
    return out


@pytest.mark.parametrize(("name", "scans", "path_m"), [("1", 713, 41.2), ("2", 2251, 87.2)])
def test_the_logs_of_wean_hall(data_folder, name, scans, path_m):
    stream = open_log(data_folder("wean_hall") / f"robotdata{name}.log.xz")
    frames = list(stream)
    assert len(frames) == stream.length == scans
    poses = np.array([f.odometry.T_odom_robot for f in frames])
    driven = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
    assert driven == pytest.approx(path_m, abs=0.5)
    np.testing.assert_allclose(stream.metadata.laser.T_robot_laser, [0.25, 0.0, 0.0], atol=1e-4)
    assert 80.0 < stream.metadata.laser.range_max < 82.0
    assert stream.metadata.truth == ""


def test_lengths_are_centimetres(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("".join(lines()))
    frames = list(open_log(path))
    assert len(frames) == 6
    np.testing.assert_allclose(frames[1].odometry.T_odom_robot, [0.1, 0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(frames[0].scan.ranges[:2], [1.0, 1.07], atol=1e-6)
    assert frames[0].scan.spec.angles[0] == pytest.approx(-math.pi / 2)
    assert frames[1].stamp == pytest.approx(0.21)


def test_a_torn_last_line_is_left_out_and_garbage_named(tmp_path, caplog):
    path = tmp_path / "a.log"
    text = "".join(lines())
    path.write_text(text[:-100])
    assert open_log(path).length == 5
    assert len(caplog.records) == 1
    with pytest.raises(LogFormatError, match=r"a\.log:12: .*refused by --strict"):
        open_log(path, strict=True)
    for old, new, match in (
        (" 107 ", " nan ", "expected a number"),
        (" 107 ", " -107 ", "ranges must be 0 to"),
        (" 107 ", " 10x ", "10x"),
        (" 107 ", " ", "the number of beams changes"),
        ("O 10", "P 10", "expected L or O, got 'P'"),
        ("O 10.0000 0.0000", "O 10.0000", "O has 5 words, got 4"),
    ):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(LogFormatError, match=rf"a\.log:\d+: .*{match}"):
            read_centimetre(path)
    path.write_text("O 1 2 3 4\n")
    with pytest.raises(LogFormatError, match="no scan found"):
        open_log(path)
