# SPDX-License-Identifier: Apache-2.0
"""Clocks whose times below 0 were written by 32 bits without a sign: 4294967295.75 s for -0.25."""

import numpy as np
import pytest

from slam.errors import LogFormatError
from slam.logs import open_log
from slam.logs.repairs import CLOCK_STEPS, STAMPS_WRAPPED, Repairs, continued, unwrapped

S = 1_000_000_000
N, STEP = 60, 0.3
LOGGED = {
    "from the start": [STEP * k - 6.0 for k in range(N)],
    "one odd": [-0.05 if k == 30 else STEP * k for k in range(N)],
    "two at the start": [STEP * k - 0.5 for k in range(N)],
    "every other": [STEP * k if k % 2 else -0.05 for k in range(N)],
    "runs of six": [0.05 * (k % 20) - 0.7 if 5 < k % 20 < 12 else STEP * k for k in range(N)],
    "at the end": [STEP * k if k < 55 else -0.05 for k in range(N)],
}
PRINTED = {"fractions": "{:.6f}", "six digits": "{:g}"}


def write(path, carmen_text, times, form, unix=0.0):
    """FLASER lines at these times, those below 0 without their sign."""
    rows = []
    for k, pose in enumerate(carmen_text.path_poses(len(times))):
        word = form.format((times[k] + (unix if times[k] >= 0.0 else 0.0)) % 2**32)
        row = carmen_text.flaser(k, 0.0, pose, pose)
        rows.append(row.replace("0.000000 host 0.000000", f"{word} host {word}"))
    path.write_text("".join(rows))
    return path


@pytest.mark.parametrize("form", PRINTED.values(), ids=list(PRINTED))
@pytest.mark.parametrize("times", LOGGED.values(), ids=list(LOGGED))
def test_times_below_0_are_put_back_among_the_others(tmp_path, carmen_text, caplog, times, form):
    path = write(tmp_path / "corridor.log", carmen_text, times, form)
    stream = open_log(path)
    frames = list(stream)
    poses = [frame.odometry.T_odom_robot for frame in frames]
    np.testing.assert_allclose(poses, carmen_text.path_poses(N), atol=1e-6)  # the file's order
    stamps = np.array([frame.stamp for frame in frames])
    assert np.diff(stamps).min() > 0.04
    assert np.diff(stamps).max() < 1.0
    sound = np.array(times) >= 0.0
    np.testing.assert_allclose(stamps[sound], np.array(times)[sound], atol=1e-6)
    assert stream.metadata.extra[STAMPS_WRAPPED] == (~sound).sum()
    (record,) = caplog.records
    assert f"{(~sound).sum()} stamps of 4.29497e+09 s" in record.getMessage()
    with pytest.raises(LogFormatError, match=r"corridor\.log:\d+: .*32 bits \(refused by --strict"):
        open_log(path, strict=True)


def test_digits_that_tell_are_kept(tmp_path, carmen_text):
    path = write(tmp_path / "a.log", carmen_text, LOGGED["from the start"], "{:.6f}")
    stamps = [frame.stamp for frame in open_log(path)]
    np.testing.assert_allclose(stamps, LOGGED["from the start"], atol=1e-6)


@pytest.mark.parametrize("name", ["one odd", "runs of six"])
def test_beside_unix_times_they_say_nothing(tmp_path, carmen_text, name):
    path = write(tmp_path / "a.log", carmen_text, LOGGED[name], "{:.6f}", unix=1.03e9)
    stamps = np.array([frame.stamp for frame in open_log(path)]) - 1.03e9
    np.testing.assert_allclose(stamps, STEP * np.arange(N), atol=0.01)


def test_a_clock_set_back_below_0_goes_on(tmp_path):
    repairs = Repairs(tmp_path)
    stamps = [10 * S, 11 * S, 12 * S, 2**32 * S - S, S // 2, 2 * S]
    stamps[3] += S // 2
    out = unwrapped(stamps, range(6), repairs)
    assert out == [10 * S, 11 * S, 12 * S, -S // 2, S // 2, 2 * S]
    assert np.diff(continued(out, range(6), repairs)).min() > 0
    assert repairs.counts == {STAMPS_WRAPPED: 1, CLOCK_STEPS: 1}


def test_clocks_of_one_kind_are_left_as_they_are(tmp_path):
    repairs = Repairs(tmp_path)
    for start in (0, 2**32 * S - 100 * S, 2_200_000_000 * S):  # the last in the year 2039
        stamps = [start + k * S for k in range(5)]
        assert unwrapped(stamps, range(5), repairs) == stamps
    assert not repairs.counts


def test_a_clock_beyond_repair_names_its_line(tmp_path, carmen_text):
    """It is set back by 130 years again and again."""
    times = [4.1e9 + k if k // 5 % 2 else float(k) for k in range(40)]
    path = write(tmp_path / "a.log", carmen_text, times, "{:.3f}")
    with pytest.raises(LogFormatError, match=r"a\.log:\d+: stamp: .* 64 bits .*, got \d"):
        open_log(path)
