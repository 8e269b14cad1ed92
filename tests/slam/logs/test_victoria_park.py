# SPDX-License-Identifier: Apache-2.0
"""The Victoria Park reader on a synthetic park in the same formats; the real one where it is."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from slam import Stream, se2
from slam.ekf import EkfSlam
from slam.errors import LogFormatError
from slam.logs import open_log, read_victoria_park
from slam.logs.victoria_park import read_gps, twist_of

DT = 0.025
START_S = 10.0


class Park:
    """A truck that circles among trees; controls each 25 ms, a scan each 0.2 s."""

    def __init__(self, duration: float = 12.0) -> None:
        rng = np.random.default_rng(1)
        self.times = START_S + DT * np.arange(round(duration / DT) + 1)
        self.speed = 3.0 + 0.5 * np.sin(0.3 * self.times)
        self.steering = 0.25 + 0.05 * np.cos(0.2 * self.times)
        self.trees = rng.uniform(-40.0, 40.0, (60, 2))
        self.poses = [np.zeros(3)]
        for v, a in zip(self.speed[:-1], self.steering[:-1], strict=True):
            self.poses.append(se2.compose(self.poses[-1], se2.exp(twist_of(v, a), DT)))
        self.scans = np.arange(0, len(self.times), 8)
        self.scan_times = self.times[self.scans]
        self.detections = [self._detect(self.poses[k], rng) for k in self.scans]

    def _detect(self, pose: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        x, y = se2.transform(se2.inverse(pose), self.trees).T
        reach, bearing = np.hypot(x, y), np.arctan2(y, x)
        seen = (reach < 25.0) & (np.abs(bearing) < math.pi / 2.0)
        seen &= rng.uniform(size=len(seen)) < 0.8
        found = np.stack([reach, bearing + math.pi / 2.0, np.full_like(reach, 0.3)])[:, seen]
        noise = rng.normal(0.0, [[0.05], [0.005], [0.0]], found.shape)
        return found + noise

    def cells(self) -> np.ndarray:
        cells = np.empty((1, len(self.scans)), dtype=object)
        for k, found in enumerate(self.detections):
            cells[0, k] = found
        return cells

    def write_trees(self, folder: Path) -> Path:
        path = folder / "features_trees.mat"
        u = np.vstack([self.speed, self.steering])
        values = {"TLsr": self.scan_times, "zt": self.cells(), "time": self.times, "u": u}
        savemat(path, values)
        return path


@pytest.fixture(scope="module")
def park() -> Park:
    return Park()


def check(stream: Stream, park: Park, tolerance: float) -> None:
    frames = list(stream)
    assert len(frames) == stream.length == len(park.scans)
    first = frames[0].odometry.T_odom_robot
    for frame, k, found in zip(frames, park.scans, park.detections, strict=True):
        assert frame.stamp == pytest.approx(park.times[k], abs=1e-6)
        T = se2.between(first, frame.odometry.T_odom_robot)
        np.testing.assert_allclose(T, park.poses[k], atol=tolerance)
        reach, bearing, _ = found
        points = np.stack([reach * np.sin(bearing), -reach * np.cos(bearing)], axis=1)
        np.testing.assert_allclose(frame.features.points_robot, points, atol=1e-4)


def test_the_trees_give_the_drive_by_their_file_and_by_their_folder(park, tmp_path):
    for path in (park.write_trees(tmp_path), tmp_path):
        stream = open_log(path)
        assert stream.metadata.source == "victoria_park"
        check(stream, park, 1e-9)


def test_the_vehicle_model_is_that_of_the_dataset():
    """x', y', phi' of the README's equations, written out."""
    v, alpha, phi, dt = 2.0, 0.3, 0.7, 1e-6
    H, L, a, b = 0.76, 2.83, 3.78, 0.50
    vc = v / (1.0 - math.tan(alpha) * H / L)
    turn = vc / L * math.tan(alpha)
    expected = [
        vc * math.cos(phi) - turn * (a * math.sin(phi) + b * math.cos(phi)),
        vc * math.sin(phi) + turn * (a * math.cos(phi) - b * math.sin(phi)),
        turn,
    ]
    start = np.array([1.0, 2.0, phi])
    moved = se2.compose(start, se2.exp(twist_of(v, alpha), dt)) - start
    np.testing.assert_allclose(moved / dt, expected, atol=1e-5)


def test_gps_is_read_in_seconds(tmp_path):
    t = np.array([1000.0, 1200.0, 1400.0])
    x, y = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    savemat(tmp_path / "aa3_gpsx.mat", {"timeGps": t[:, None], "Lo_m": x, "La_m": y})
    found = read_gps(tmp_path)
    np.testing.assert_array_equal(found.points, np.column_stack([x, y]))
    assert found.stamps_ns.tolist() == [10**9, 12 * 10**8, 14 * 10**8]
    savemat(tmp_path / "aa3_gpsx.mat", {"timeGps": t, "Lo_m": x, "La_m": y * np.nan})
    with pytest.raises(LogFormatError, match="fix 0, y: expected a number"):
        read_gps(tmp_path)


def test_without_data_the_error_says_so(tmp_path):
    for path in (tmp_path, tmp_path / "features_trees.mat"):
        with pytest.raises(LogFormatError, match=r"no Victoria Park here .*README"):
            read_victoria_park(path)
    with pytest.raises(LogFormatError, match="no GPS here"):
        read_gps(tmp_path)


def test_damaged_matlab_files_are_refused(park, tmp_path):
    path = park.write_trees(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(LogFormatError, match=r"features_trees\.mat"):
        open_log(path)
    savemat(path, {"zt": park.cells(), "TLsr": park.scan_times[:-1]})
    with pytest.raises(LogFormatError, match="no variable 'u'"):
        open_log(path)
    u = np.vstack([park.speed, park.steering])
    savemat(path, {"zt": park.cells(), "TLsr": park.scan_times[:-1], "time": park.times, "u": u})
    with pytest.raises(LogFormatError, match="detections of"):
        open_log(path)
    backwards = park.scan_times[::-1]
    savemat(path, {"zt": park.cells(), "TLsr": backwards, "time": park.times, "u": u})
    with pytest.raises(LogFormatError, match="do not increase"):
        open_log(path)


@pytest.mark.slow
def test_the_real_park_is_closed(data_folder):
    """4 km without divergence: GPS lies along the path as it does along the optimised graph."""
    folder = data_folder("victoria_park")
    stream = open_log(folder)
    assert stream.length == 7249
    assert stream.metadata.extra["detections"] == 52974
    assert stream.metadata.extra["gps_file"] == "aa3_gpsx.mat"
    system = EkfSlam(preset="victoria_park")
    assert all(system.update(frame).converged for frame in stream)
    trajectory, gps = system.trajectory(), read_gps(folder)
    path = np.column_stack(
        [np.interp(gps.stamps_ns, trajectory.stamps_ns, trajectory.poses[:, k]) for k in (0, 1)]
    )
    kept = np.arange(len(path))
    for _ in range(15):  # fixes that are off by metres must not turn the map
        T = se2.fit(path[kept], gps.points[kept])
        away = np.linalg.norm(se2.transform(T, path) - gps.points, axis=1)
        kept = np.flatnonzero(away <= np.quantile(away, 0.8))
    assert np.median(away) < 1.5  # 0.94 measured; the optimised graph has 0.96
    assert np.quantile(away, 0.8) < 3.5
    assert 3900.0 < trajectory.length_m() < 4300.0
    assert 100 < len(system.landmarks().keys) < 350
