# SPDX-License-Identifier: Apache-2.0
"""What is usual in public logs is repaired, counted and said once; a strict reader refuses it."""

import lzma
from itertools import pairwise

import numpy as np
import pytest

from slam.errors import LogFormatError
from slam.logs import open_log, read_carmen
from slam.logs.repairs import CLOCK_STEPS, STRAY_STAMPS, Repairs, continued, put_in_order

S = 1_000_000_000


def seconds(*values):
    return [round(v * S) for v in values]


def test_a_clock_that_is_set_back_goes_on(tmp_path):
    repairs = Repairs(tmp_path)
    out = continued(seconds(10.0, 10.5, 11.0, 9.6, 10.1, 10.6, 11.1), range(7), repairs)
    assert out == seconds(10.0, 10.5, 11.0, 11.5, 12.0, 12.5, 13.0)
    assert repairs.counts == {CLOCK_STEPS: 1}
    with pytest.raises(LogFormatError, match=r":3: time steps back by 1.4 s \(refused by --strict"):
        continued(seconds(10.0, 10.5, 11.0, 9.6, 10.1), range(5), Repairs(tmp_path, strict=True))


@pytest.mark.parametrize("stray", [0.0, 1e6])
def test_a_stray_stamp_moves_nothing_else(tmp_path, stray):
    repairs = Repairs(tmp_path)
    out = continued(seconds(10.0, 10.5, stray, 11.5, 12.0), range(5), repairs)
    assert out == seconds(10.0, 10.5, 10.5, 11.5, 12.0)
    assert repairs.counts == {STRAY_STAMPS: 1}


def test_a_step_that_only_the_rounding_made_is_none(tmp_path):
    """Of times in whole seconds."""
    repairs = Repairs(tmp_path)
    stamps = seconds(1000, 1001, 1003, 1002, 1004)
    assert continued(stamps, range(5), repairs, digits=4) == stamps
    assert not repairs.counts


def test_many_equal_stamps_are_spread_by_the_steps_between(tmp_path):
    """Two ticks of 10 000 s for 200 scans: the pause between the ticks is none."""
    steps = [0.5 if k % 2 else 1.5 for k in range(199)]
    stamps = seconds(*[1.13486e9] * 150, *[1.13487e9] * 50)
    repairs = Repairs(tmp_path)
    ordered = put_in_order(tmp_path, stamps, range(200), repairs=repairs, steps_s=steps, digits=6)
    np.testing.assert_allclose(np.diff(ordered.stamps_ns) / S, steps, atol=1e-6)
    assert ordered.order == list(range(200))


def test_equal_stamps_within_a_tick_keep_the_time_of_the_log(tmp_path):
    stamps = seconds(1000, 1000, 1001, 1001, 1003, 1004, 1004, 1004, 1006)
    ordered = put_in_order(tmp_path, stamps, range(9), steps_s=[1.0] * 8, digits=4)
    got = np.array(ordered.stamps_ns) / S
    assert all(b > a for a, b in pairwise(got))
    assert np.abs(got - np.array(stamps) / S).max() <= 2.0
    assert got[-1] == 1006.0


def test_a_public_log_with_two_times_for_406_scans(data_folder, caplog):
    """MIT CSAIL, printed with six digits; the filter's own log has the true times."""
    folder = data_folder("mit_csail")
    stream = open_log(folder / "csail-corrected.log.xz")
    assert stream.length == 406
    assert stream.metadata.extra["stamps_equal_spread"] == 404
    (record,) = caplog.records
    assert "404 scans with the time of another" in record.getMessage()
    with lzma.open(folder / "csail-gfs.log.xz", "rt") as file:
        true = [float(row.split()[-1]) for row in file if row.startswith("LASER_READING")]
    ratio = np.diff([f.stamp for f in stream]) / np.diff(true)
    assert 0.5 < np.percentile(ratio, 1) < np.percentile(ratio, 99) < 2.0
    with pytest.raises(LogFormatError, match=r"have the time of another.*--strict"):
        open_log(folder / "csail-corrected.log.xz", strict=True)


def test_all_repairs_of_a_log_are_said_in_one_warning(tmp_path, carmen_text, caplog):
    poses = carmen_text.path_poses(40)
    times = [0.5 * k for k in range(40)]
    times[20:] = [t - 1.4 - 0.5 for t in times[20:]]
    times[5] = times[4]
    rows = [carmen_text.flaser(k, times[k], poses[k], poses[k]) for k in range(40)]
    path = tmp_path / "a.clf"
    path.write_text("".join(rows)[:-40])
    frames = list(open_log(path))
    assert len(caplog.records) == 1
    for words in ("1 torn end", "1 times the clock steps back", "1 scans with the time of another"):
        assert words in caplog.records[0].getMessage()
    np.testing.assert_allclose([f.odometry.T_odom_robot for f in frames], poses[:39], atol=1e-6)
    assert np.ptp(np.diff([f.stamp for f in frames])) < 0.51
    with pytest.raises(LogFormatError, match="refused by --strict"):
        read_carmen(path, strict=True)


def test_rawlaser_of_one_time_keeps_to_the_odometry_around_it(tmp_path, carmen_text):
    """Scans and ODOM lines that share their stamps are spread together, in their order."""
    poses = carmen_text.path_poses(30)
    rows = []
    for k, pose in enumerate(poses):
        rows += [carmen_text.odom(1e9, pose), carmen_text.rawlaser(k, 1e9)]
    (tmp_path / "a.log").write_text("".join([*rows, carmen_text.odom(1e9, poses[-1])]))
    frames = list(read_carmen(tmp_path / "a.log"))
    assert len(frames) == 30
    for frame, a, b in zip(frames, poses, poses[1:], strict=False):
        middle = 0.5 * (a[:2] + b[:2])
        np.testing.assert_allclose(frame.odometry.T_odom_robot[:2], middle, atol=0.01)
