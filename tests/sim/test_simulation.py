# SPDX-License-Identifier: Apache-2.0
"""Frames and moments of the moving world: one seed, same bytes; each says what is, and when."""

import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from sim.core.seeds import Seeds
from sim.moments import Moment, thinned
from sim.simulation import Simulation, tour
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import Frame, Odometry

pytestmark = pytest.mark.slow
DIGEST = """
import hashlib, sys
from sim.simulation import stream
from slam import create
slam, digest = create("shunting"), hashlib.sha256()
for frame in stream("office", seed=int(sys.argv[1]), dynamism=0.7, seconds=2.0):
    estimate = slam.update(frame.without_truth())
    for part in (frame.scan.ranges, frame.odometry.T_odom_robot,
                 frame.odometry.increment_covariance, frame.truth,
                 estimate.T_map_robot, estimate.covariance):
        digest.update(part.tobytes())
print(digest.hexdigest())
"""


def elsewhere(code: str, *words: str) -> str:
    """What it prints in another process."""
    command = [sys.executable, "-c", code, *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def here(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """What it prints in this process."""

    def run(code: str, *words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["-c", *words])
        exec(code, {})
        return capsys.readouterr().out

    return run


def test_two_processes_agree_on_every_byte_and_another_seed_does_not(here):
    first = here(DIGEST, "5")
    assert first == elsewhere(DIGEST, "5")
    assert first != here(DIGEST, "6")


def test_wrong_settings_are_refused_by_name():
    with pytest.raises(UnknownNameError, match="Did you mean 'office'"):
        Simulation("ofice")
    with pytest.raises(InvalidValueError, match="dynamism must be a number from"):
        Simulation("arena", dynamism=2.0)
    with pytest.raises(InvalidValueError, match="seconds must be > 0"):
        list(tour(Simulation("arena"), -1.0))
    with pytest.raises(UnknownNameError, match="pioneer3dx"):
        Simulation("arena", odometry="pioneer")


RESUME = """
import hashlib, sys
from sim.simulation import Simulation
simulation = Simulation("office", seed=5, dynamism=0.9, labels=True)
simulation.world.set_command(0.3, 0.1)
if sys.argv[1] == "resume":
    simulation.load_state(open(sys.argv[2], "rb").read())
else:
    for _ in range(90):
        simulation.observe()
    with open(sys.argv[2], "wb") as file:
        file.write(simulation.save_state())
sha = hashlib.sha256()
for _ in range(90):
    frame = simulation.observe()
    for part in (frame.scan.ranges, frame.odometry.T_odom_robot, frame.truth,
                 frame.odometry.increment_covariance, frame.odometry.twist,
                 frame.labels.displacement, frame.labels.kind, frame.labels.mixed):
        sha.update(part.tobytes())
print(frame.stamp_ns, sha.hexdigest())
"""


def test_a_saved_simulation_goes_on_scan_for_scan_in_another_process(tmp_path, here):
    state = str(tmp_path / "state")
    assert here(RESUME, "plain", state) == elsewhere(RESUME, "resume", state)


def test_a_state_of_another_simulation_is_refused():
    ours = Simulation("arena", seed=1, n_chairs=2)
    with pytest.raises(InvalidValueError, match="not of a simulation"):
        ours.load_state(ours.world.save_state())
    with pytest.raises(InvalidValueError, match="odometry errs otherwise"):
        ours.load_state(Simulation("arena", seed=Seeds(1, odometry=2), n_chairs=2).save_state())
    with pytest.raises(InvalidValueError, match="this world is"):
        ours.load_state(Simulation("arena", seed=1, n_chairs=3).save_state())


def moments(stated):
    for k, part in enumerate(stated):
        covariance = None if part is None else np.diag([part, part, part])
        odometry = Odometry(stamp_ns=k, T_odom_robot=np.zeros(3), increment_covariance=covariance)
        frame = Frame(stamp_ns=k, odometry=odometry)
        yield Moment(frame=frame, poses=np.zeros((0, 3)), moving=np.zeros(0, dtype=np.bool_))


@pytest.mark.parametrize(
    ("stated", "kept"),
    [
        ([0.5, 1.0, 2.0, 4.0, 8.0], [0.5, 3.0, 12.0]),
        ([None, 1.0, 2.0, None, 4.0], [None, 3.0, None]),
        ([None] * 3, [None, None]),
    ],
)
def test_covariances_are_added_up_and_none_stays_none(stated, kept):
    found = [moment.frame.odometry.increment_covariance for moment in thinned(moments(stated), 2)]
    assert [None if c is None else c[0, 0] for c in found] == kept
