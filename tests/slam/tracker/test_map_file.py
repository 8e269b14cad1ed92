# SPDX-License-Identifier: Apache-2.0
"""A map written and read back is the same map, and whatever is no map is refused by name."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam import se2
from slam.errors import LogFormatError, OutputError
from slam.frames import Frame
from slam.grid.occupancy import OccupancySlam
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker import map_file as memory
from tests.world2d import Drive, World2D, arena, frames, laser, rectangle, wander

ROOMS = World2D(np.vstack([arena(), rectangle(-2.0, 1.0, -1.2, 2.2)]))
CONFIG = ShuntingConfig(cell_m=0.05, trace_s=2.5)


def driven() -> tuple[ShuntingSlam, list[Frame]]:
    stream = frames(ROOMS, wander(1.0), rate_hz=5.0, spec=laser(181), seed=7)[:70]
    slam = ShuntingSlam(CONFIG)
    for frame in stream:
        slam.update(frame.without_truth())
    return slam, stream


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ShuntingSlam, list[Frame]]:
    slam, stream = driven()
    path = tmp_path_factory.mktemp("maps") / "rooms.npz"
    slam.save(path)
    return path, slam, stream


def test_round_trip_is_exact(saved: tuple[Path, ShuntingSlam, list[Frame]], tmp_path: Path) -> None:
    path, slam, _ = saved
    back = ShuntingSlam.load(path)
    assert back.config == CONFIG
    extent = slam.cell_map.extent()
    assert back.cell_map.extent() == extent
    assert extent is not None
    i0, j0, i1, j1 = (0.05 * edge for edge in extent)
    for before, after in zip(slam.window(i0, j0, i1, j1), back.window(i0, j0, i1, j1), strict=True):
        np.testing.assert_array_equal(after, before)
    raster, again = slam.map(), back.map()
    assert raster is not None
    assert again is not None
    np.testing.assert_array_equal(again.values, raster.values)
    back.save(tmp_path / "again.npz")
    with np.load(path) as one, np.load(tmp_path / "again.npz") as other:
        assert sorted(one.files) == sorted(other.files)
        for name in set(one.files) - {"header"}:
            np.testing.assert_array_equal(one[name], other[name])
    assert len(back.trajectory()) == 0


def test_a_loaded_map_is_localised_in_at_once(saved: tuple[Path, ShuntingSlam, list[Frame]]):
    """The next day: odometry and clock start anew, the robot was nudged by 8 cm and 3 degrees."""
    path, _, stream = saved
    assert stream[0].truth is not None
    assert stream[-1].truth is not None
    at = se2.compose(se2.between(stream[0].truth, stream[-1].truth), [0.08, 0.0, 0.05])
    slam = ShuntingSlam.load(path)
    for frame in frames(ROOMS, Drive(tuple(at), ((0.2, 0.3, 4.0),)), rate_hz=5.0, seed=9):
        estimate = slam.update(frame.without_truth())
        assert frame.truth is not None
        assert estimate.converged
        np.testing.assert_allclose(estimate.T_map_robot, frame.truth, atol=0.03)


def test_a_robot_that_was_carried_off_finds_itself_in_the_loaded_map(saved):
    slam = ShuntingSlam.load(saved[0])
    drive = Drive((3.0, 2.5, -1.0), ((0.2, 0.3, 4.0),))
    for frame in frames(ROOMS, drive, rate_hz=5.0, seed=9):
        estimate = slam.update(frame.without_truth())
        assert not estimate.converged or abs(estimate.T_map_robot - frame.truth).max() < 0.05
    assert estimate.converged


def test_an_empty_map_is_a_map(tmp_path: Path) -> None:
    ShuntingSlam(CONFIG).save(tmp_path / "empty.npz")
    assert ShuntingSlam.load(tmp_path / "empty.npz").cell_map.extent() is None


def rewritten(source: Path, target: Path, **changes: Any) -> Path:
    """The file with other header entries or arrays."""
    with np.load(source) as archive:
        content = {name: archive[name] for name in archive.files}
    header = json.loads(str(content["header"]))
    del header["sha256"]
    for name, value in changes.items():
        if name in content and np.ndim(value) == 0:
            content[name] = content[name].copy()
            content[name].flat[0] = value
        elif name in content:
            content[name] = value
        else:
            header[name] = value
    content["header"] = np.array(json.dumps(header))
    with target.open("wb") as file:
        np.savez(file, **content)
    return target


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"version": 3}, "version 3 of a mobilia shunting memory; 1 and 2 are known"),
        ({"version": 2}, "extra must name arrays"),
        ({"format": "somebody's"}, "not a mobilia shunting memory"),
        ({"config": {"cell_m": -1.0}}, "cell_m"),
        ({"state": {}}, "T_map_robot"),
        ({"places": np.zeros((1, 2), np.int64)}, "x must be finite float32"),
        ({"x": np.float32(1.5)}, r"x must lie in \[0, 1\]"),
        ({"places": np.int64(2**62)}, "places must lie within"),
        ({"somebody": 1}, "its header has 'somebody'"),
        ({"sha256": "0" * 64}, "its content is not what was written"),
    ],
)
def test_what_is_no_such_file_is_refused(saved, tmp_path, changes, match):
    path = rewritten(saved[0], tmp_path / "changed.npz", **changes)
    with pytest.raises(LogFormatError, match=match) as caught:
        ShuntingSlam.load(path)
    assert str(path) in str(caught.value)


def test_cut_and_foreign_files_are_refused(saved, tmp_path):
    (tmp_path / "cut.npz").write_bytes(saved[0].read_bytes()[:-30])
    for name in ("cut.npz", "missing.npz"):
        with pytest.raises(LogFormatError, match=name):
            ShuntingSlam.load(tmp_path / name)
    with pytest.raises(LogFormatError, match="a map of ShuntingSlam, not of OccupancySlam"):
        OccupancySlam.load(saved[0])
    (tmp_path / "file").touch()
    with pytest.raises(OutputError):
        saved[1].save(tmp_path / "file" / "map.npz")


def test_a_map_of_before_sums_is_read_and_said_so(saved, tmp_path, caplog):
    path = rewritten(saved[0], tmp_path / "older.npz")
    back = ShuntingSlam.load(path)
    assert back.cell_map.extent() == saved[1].cell_map.extent()
    assert "older.npz: a map of before sums" in caplog.text


@pytest.mark.parametrize(("freeze_below", "carried_per_h"), [(0.6, None), (0.0, 0.0)])
def test_a_map_of_before_one_belief_is_read(saved, tmp_path, freeze_below, carried_per_h):
    """What it says of mechanisms that are gone is passed over, but whether a pose is doubted."""
    path, slam, stream = saved
    with np.load(path) as archive:
        header = json.loads(str(archive["header"]))
    config, state = header["config"], header["state"]
    for name in ("belief", "carried_per_h"):
        del config[name]
    config["freeze_below"] = freeze_below
    config["standing"] |= {
        "fallen": 0.8, "rival_scans": 3, "undecided_s": 2.0, "long_window_s": 8.0,
    }  # fmt: skip
    config["belief"] = {"through_per_m": 3.0, "changed_per_m": 0.64}
    config["tracking"] |= {
        "quality": {"lost_after": 3, "give_up_s": 60.0}, "verdict": {"even": 0.45, "steep": 20.0},
    }  # fmt: skip
    config["tracking"]["relocalise"] |= {"enough": 0.8, "sure": 0.65}
    state |= {"supports": [0.5, 0.6], "tracked_s": 14.0, "tracked": 70}
    old = rewritten(path, tmp_path / "old.npz", config=config, state=state)
    back = ShuntingSlam.load(old)
    wanted = CONFIG if carried_per_h is None else CONFIG.changed({"carried_per_h": carried_per_h})
    assert back.config == wanted
    assert back.cell_map.extent() == slam.cell_map.extent()
    estimate = back.update(stream[-1].without_truth())
    np.testing.assert_allclose(estimate.T_map_robot, slam._T_map_robot, atol=0.03)
    config["standing"]["falen"] = 0.8
    with pytest.raises(LogFormatError, match="falen"):
        ShuntingSlam.load(rewritten(path, tmp_path / "typo.npz", config=config))


def test_a_map_of_before_shares_were_weighed_is_read(saved, tmp_path):
    with np.load(saved[0]) as archive:
        config = json.loads(str(archive["header"]))["config"]
    for number in ("again", "best", "far_m", "hidden", "hidden_m", "known", "more_m", "new"):
        del config["belief"][number]
    gone = "alike breaks broken confirmed confirmed_m goes_on linear_m nearby_per_m outdated place"
    gone += " pulled_m pulled_rad searched slip_m slip_rad slips_per_m through unsearched vanished"
    config["belief"] |= dict.fromkeys(gone.split(), 0.5) | {"frozen_above": 0.02}
    config["matching"]["usual"] |= {"fallen": 0.8, "odd": 0.7, "outvoted": 0.75}
    config["matching"]["budget"] |= {"weigh_ns": 100.0}
    config["standing"] |= {"alert_m": 0.5}
    config["tracking"]["relocalise"] |= {"kept": 20}
    back = ShuntingSlam.load(rewritten(saved[0], tmp_path / "old.npz", config=config))
    assert back.config == CONFIG.changed({"belief.frozen_above": 0.02})


def test_a_file_that_unpacks_to_too_much_is_refused(saved, monkeypatch):
    monkeypatch.setattr(memory, "MAX_BYTES", 1 << 12)
    with pytest.raises(LogFormatError, match=r"rooms\.npz: unpacks to \d+ bytes; at most 4096"):
        ShuntingSlam.load(saved[0])
