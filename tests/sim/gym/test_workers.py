# SPDX-License-Identifier: Apache-2.0
"""Workers: the same rooms, errors as in one process, and nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from operator import attrgetter, methodcaller
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from sim.gym import env as environment
from sim.gym.env import MobiliaEnv
from sim.gym.vector import MobiliaVectorEnv
from sim.gym.workers import RoomsEndedError
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
SHORT = {"scene": "arena", "time_limit_s": 0.15, "goal": "random"}
STILL = np.zeros((2, 2))
ORPHANED = """
import numpy, os, sys
from sim.gym.vector import MobiliaVectorEnv
rooms = MobiliaVectorEnv(2, n_workers=2, scene="arena")
rooms.reset(seed=1)
print(*(process.pid for process, _ in rooms._rooms._workers), flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def rooms():
    """To start workers takes seconds of each; the first test finds them as they were made."""
    many = MobiliaVectorEnv(3, n_workers=2, **SHORT)
    yield many
    many.close()


def test_errors_and_objects_come_from_workers_as_from_here(rooms):
    here = MobiliaVectorEnv(3, **SHORT)
    for options, words in ({"gaol": 1}, "unknown key 'gaol'"), ({"goal": (99, 0)}, "goal"):
        for many in (rooms, here):
            with pytest.raises(InvalidValueError, match=words):
                many.reset(seed=1, options=options)
    with pytest.raises(gymnasium.error.ResetNeeded):
        rooms.step(np.zeros((3, 2)))
    with pytest.raises(InvalidValueError, match="another process"):
        rooms.reset(options={"laser": lambda: 1})
    for step in range(6):
        told = [m.step(np.full((3, 2), 0.2)) if step else m.reset(seed=4) for m in (rooms, here)]
        frames = [m.each(attrgetter("simulation.frame")) for m in (rooms, here)]
        assert frames[0] == frames[1]
        assert step == 0 or told[0][3].tolist() == told[1][3].tolist() == [step == 5] * 3
    times = attrgetter("simulation.world.time_ns")
    assert rooms.each(times) == here.each(times)
    assert rooms.each(methodcaller("__getattribute__", "time_limit_s"), [2]) == [0.15]
    with pytest.raises(AttributeError, match="nothing") as raised:
        rooms.each(attrgetter("nothing"))
    assert "Traceback" in raised.value.__notes__[0]
    with pytest.raises(InvalidValueError, match="room"):
        rooms.each(times, [3])
    here.close()


def test_rooms_that_are_closed_say_so_with_workers_and_without():
    for workers in (0, 1):
        many = MobiliaVectorEnv(2, n_workers=workers, scene="arena")
        many.reset(seed=1)
        many.close()
        for asked in (lambda many=many: many.reset(seed=1), lambda many=many: many.step(STILL)):
            with pytest.raises(RoomsEndedError, match="closed"):
                asked()


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_that_holds_the_pipes_does_not_keep_workers():
    many = MobiliaVectorEnv(2, n_workers=1, scene="arena")
    child = os.fork()
    if child == 0:
        time.sleep(60.0)
        os._exit(0)
    try:
        workers = [process for process, _ in many._rooms._workers]
        many.close()
        assert [process.returncode for process in workers] == [0]  # it was not killed
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def interrupted() -> None:
    """As SIGINT does, which a shell's background jobs ignore."""
    raise KeyboardInterrupt


def test_an_answer_that_an_interrupt_left_behind_is_not_taken_for_the_next(rooms):
    rooms.reset(seed=1)
    worker = rooms._rooms._workers[0][1]
    receive, worker.recv = worker.recv, interrupted
    with pytest.raises(KeyboardInterrupt):
        rooms.step(np.zeros((3, 2)))
    worker.recv = receive
    times = rooms.each(attrgetter("simulation.world.time_ns"))
    assert len(set(times)) == 1


def test_a_killed_worker_is_an_error_and_the_others_end():
    many = MobiliaVectorEnv(2, n_workers=2, **SHORT)
    many.reset(seed=1)
    processes = [process for process, _ in many._rooms._workers]
    processes[1].kill()
    for _ in range(2):
        with pytest.raises(RoomsEndedError, match=r"ended \(signal 9\)"):
            many.step(STILL)
    assert [process.returncode for process in processes] == [0, -signal.SIGKILL]
    many.close()


@pytest.mark.parametrize("said", [True, False])
def test_closing_while_rooms_are_built_ahead_leaves_nothing(said):
    many = MobiliaVectorEnv(4, n_workers=1, autoreset_mode="next_step", scene="office")
    many.reset(seed=1)  # four rooms are being built, which takes half a second
    processes = [process for process, _ in many._rooms._workers]
    if said:
        many.close()
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            many.reset()
    del many
    assert [process.returncode for process in processes] == [0]


def test_workers_end_with_a_parent_that_is_killed():
    words = [sys.executable, "-c", ORPHANED]
    root = Path(environment.__file__).parents[2]
    with subprocess.Popen(
        words, cwd=root, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as parent:
        workers = [int(word) for word in parent.stdout.readline().split()]
        assert len(workers) == 2
        parent.kill()
    deadline = time.monotonic() + 20.0
    while any(map(runs, workers)):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def runs(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


def test_what_a_worker_cannot_load_is_refused_and_the_rooms_go_on(rooms, monkeypatch):
    """As a function of the script that runs, which its workers do not have."""
    rooms.reset(seed=1)
    monkeypatch.setattr(sys.modules["__main__"], "own", own, raising=False)
    monkeypatch.setattr(own, "__module__", "__main__")
    with pytest.raises(InvalidValueError, match=r"another process.*'own'"):
        rooms.each(own)
    assert rooms.step(np.zeros((3, 2)))[1].shape == (3,)


def own(room: MobiliaEnv) -> float:
    return room.time_limit_s
