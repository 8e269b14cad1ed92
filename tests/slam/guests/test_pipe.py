# SPDX-License-Identifier: Apache-2.0
"""A SLAM in a process of its own: heard exactly, judged by how it fails, never left behind."""

import gc
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from slam import create
from slam.errors import InvalidValueError, SlamFailedError, UnknownNameError
from slam.frames import Frame
from slam.guests import Limits, PipeSlam, guarded, limited, protocol
from slam.guests.serve import Server
from slam.replay import Track
from slam.system import RunsAtTheEnd
from tests.world2d import World2D, arena, frames, laser, wander

pytestmark = pytest.mark.slow
CLIENT = Path(__file__).with_name("misbehaving.py")


@pytest.fixture(scope="module")
def stream() -> list[Frame]:
    return frames(World2D(arena()), wander(4.0), rate_hz=5.0, spec=laser(181), seed=4)[:8]


def piped(fault: str, scan_s: float = 5.0) -> PipeSlam:
    command = [sys.executable, "-S", "-E", str(CLIENT), fault]
    return PipeSlam(command, scan_limit_s=scan_s, first_limit_s=10.0)


def gone(pid: int, within_s: float = 5.0) -> bool:
    """Whether the process ends; one that nobody has reaped yet has ended."""
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False


def test_a_good_guest_comes_through_and_starts_anew(stream):
    slam = piped("none")
    track = Track("good", slam)
    assert track.survive(stream) is None
    np.testing.assert_array_equal(track.online().poses[:, 0], np.arange(1, 9))
    np.testing.assert_array_equal(track.covariances(), 0.0)
    assert track.map() is None
    assert track.final() is None
    assert all(seconds >= 0.0 for seconds in track.durations_s)
    slam.reset()
    assert len(slam.trajectory()) == 0
    assert slam.update(stream[5]).T_map_robot[0] == 1.0


@pytest.mark.parametrize(
    ("fault", "outcome", "says"),
    [
        ("crash", "raised", "its process was ended by SIGSEGV"),
        ("exit", "raised", "its process ended with status 3; its last words: 'out of | ideas'"),
        ("close", "raised", "closed its standard output"),
        ("hang", "hung", "no answer within 0.8 s"),
        ("spin", "hung", "no answer within 0.8 s"),
        ("half", "hung", "no answer within 0.8 s"),
        ("garbage", "bad", "no JSON object but 'Segmentation fault (just kidding)'"),
        ("error", "raised", "no idea at all"),
        ("terminal", "raised", "\\x1b]0;owned\\x07\\x9b2J\\u202e=1+1"),
        ("other", "bad", "answered 'map' where 'estimate' was expected"),
        ("nan", "nan", "must be finite"),
        ("short", "bad", "T_map_robot must be 3 values"),
        ("stamp", "bad", "answered for 1 ns instead of"),
    ],
)
def test_each_fault_ends_the_guest_and_nothing_else(stream, fault, outcome, says):
    slam = piped(fault, scan_s=0.8 if outcome == "hung" else 5.0)
    track = Track(fault, slam)
    failure = track.survive(stream)
    assert isinstance(failure, SlamFailedError)
    assert failure.outcome == outcome
    assert str(failure).startswith(f"SLAM '{fault}', scan 2, ")
    assert says in str(failure)
    assert str(failure).isprintable()
    assert len(track.estimates) == 2
    assert gone(slam._wire.pid)
    with pytest.raises(SlamFailedError, match="is over since it failed"):
        slam.update(stream[4])
    slam.reset()
    assert slam.update(stream[4]).T_map_robot[0] == 1.0


def test_an_answer_too_many_puts_it_out_of_step(stream):
    failure = Track("twice", piped("twice")).survive(stream)
    assert failure is not None
    assert failure.outcome == "bad"
    assert "scan 3" in str(failure)


def test_much_said_on_standard_error_blocks_nothing(stream):
    assert Track("chatter", piped("chatter")).survive(stream) is None


class Counting(bytearray):
    """Counts the bytes that are looked through."""

    looked_at = 0

    def find(self, what, start=0):
        self.looked_at += len(self) - start
        return super().find(what, start)


def test_a_long_line_is_looked_through_once(stream):
    """It comes in pieces of a pipe's size. To look from its begin each time took 40 s of a map."""
    slam = piped("long")
    slam._wire._heard = heard = Counting()
    assert Track("long", slam).survive(stream) is None
    assert 1 << 22 < heard.looked_at < 1 << 23


def test_the_first_scan_may_take_longer(stream):
    assert Track("slow", piped("slow start", scan_s=0.8)).survive(stream[:2]) is None


def test_a_guest_that_takes_no_more_input_hangs(stream):
    hello = '{"type":"hello","protocol":"mobilia-slam","version":1}'
    slam = PipeSlam(["sh", "-c", f"read x; echo '{hello}'; exec sleep 60"], first_limit_s=1.0)
    failure = Track("deaf", slam).survive(stream * 40)  # one frame would fit into the pipe
    assert failure is not None
    assert failure.outcome == "hung"


def test_a_map_that_fails_leaves_the_poses(stream):
    track = Track("map", piped("map"))
    assert track.survive(stream) is None
    with pytest.raises(SlamFailedError, match=r"SLAM 'map', map\(\) lost it"):
        track.map()
    assert len(track.online()) == 8
    assert track.final() is None


def test_it_ends_when_nobody_holds_it_any_more(stream):
    slam = piped("none")
    pid = slam._wire.pid
    slam.update(stream[0])
    assert not gone(pid, 0.05)
    del slam
    gc.collect()
    assert gone(pid)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("pipe:", "needs a command"),
        ("pipe:./not-there --x", "cannot start './not-there': No such file"),
        ("pipe:echo 'x", "No closing quotation"),
    ],
)
def test_a_command_that_cannot_be_is_said_at_once(name, says):
    with pytest.raises(InvalidValueError, match=says):
        create(name)


def test_a_guest_of_another_version_or_without_a_word_is_not_made():
    with pytest.raises(SlamFailedError, match=r"cannot be made: speaks 'mobilia-slam' version 2"):
        create(f"pipe:{sys.executable} {CLIENT} future")
    with pytest.raises(SlamFailedError, match=r"no answer within 0\.3 s") as got:
        create(f"pipe:{sys.executable} {CLIENT} mute", first_limit_s=0.3)
    assert got.value.outcome == "hung"
    with pytest.raises(SlamFailedError, match="cannot be made: its process ended with status 0"):
        create("pipe:true")


SYSTEMS = '''
import sys
import numpy as np
from slam import Estimate
from slam.odometry import OdometrySlam

class Looping(OdometrySlam):
    """Prints where the protocol is spoken, reads what is not for it, then never comes back."""
    def __init__(self, word="hello"):
        super().__init__()
        self.word = word
    def update(self, frame):
        print(self.word, sys.stdin.read(), flush=True)
        while len(self._path) == 6: pass
        return super().update(frame)

class OverFiles(OdometrySlam):
    """Says at the end that it was all at x = 7, or fails."""
    def __init__(self, fails=False):
        super().__init__()
        self.fails = fails
    def finish(self):
        raise RuntimeError("a method of mine that is nobody's business")
    def estimates_at_end(self):
        if self.fails: raise RuntimeError("no such file")
        stamps = self.trajectory().stamps_ns.tolist()
        return [(Estimate(stamp_ns=t, T_map_robot=[7.0, 0.0, 0.0], covariance=np.eye(3)), 0.25)
                for t in stamps]

def fails():
    return OverFiles(fails=True)
'''


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own")
    (folder / "own_systems.py").write_text(SYSTEMS)
    return folder


def test_a_class_behind_the_pipe_says_the_same_as_here_and_its_loop_is_not_ours(
    own, stream, monkeypatch
):
    monkeypatch.syspath_prepend(own)
    child = Track("child", guarded("own_systems:Looping", Limits(scan_s=1.0), word="no idea"))
    here = Track("here", create("odometry"))
    assert here.survive(stream[:6]) is None
    assert child.survive(stream[:6]) is None
    assert child.final() is None
    assert child.map() is None
    failure = child.survive(stream[6:])
    assert failure is not None
    assert failure.outcome == "hung"
    assert "last words: 'no idea" in str(failure)
    np.testing.assert_array_equal(child.online().poses, here.online().poses)
    np.testing.assert_array_equal(child.covariances(), here.covariances())
    assert sum(child.durations_s) > 0.0
    assert gone(child.system._wire.pid)


def test_a_program_over_files_runs_at_the_end_behind_the_pipe_too(own, stream, monkeypatch):
    monkeypatch.syspath_prepend(own)
    track = Track("files", limited("own_systems:OverFiles", Limits()))
    assert isinstance(track.system, PipeSlam)
    assert isinstance(track.system, RunsAtTheEnd)
    assert not isinstance(piped("none"), RunsAtTheEnd)  # its hello promises none
    assert track.survive(stream) is None
    np.testing.assert_array_equal(track.online().poses, [[7.0, 0.0, 0.0]] * len(stream))
    np.testing.assert_array_equal(track.covariances()[0], np.eye(3))
    assert sum(track.durations_s) > 0.25 * len(stream)
    pid = track.system._wire.pid
    del track
    assert gone(pid)


def test_a_program_over_files_that_fails_has_no_poses(own, stream, monkeypatch):
    monkeypatch.syspath_prepend(own)
    track = Track("files", limited("own_systems:fails", Limits()))
    failure = track.survive(stream)
    assert "estimates_at_end() raised RuntimeError: no such file" in str(failure)
    assert (len(track.online()), track.durations_s) == (0, [])  # odometry's are not its own


def test_a_program_over_files_that_failed_at_a_scan_is_not_run(own, stream, monkeypatch):
    monkeypatch.syspath_prepend(own)
    track = Track("files", limited("own_systems:OverFiles", Limits()))
    assert track.survive(stream[:3]) is None
    with pytest.raises(InvalidValueError):
        track.system.update(stream[0])
    track.system.close()
    assert track.survive(stream[3:]) is not None
    assert (len(track.online()), track.durations_s) == (0, [])


AT = {"stamp_ns": 5, "T_map_robot": [0.0, 0.0, 0.0]}


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"estimates": [], "processor_s": []}, "answered 0 estimates"),
        ({"estimates": [7], "processor_s": [0.0]}, "must be a table, got 7"),
        ({"estimates": [AT], "processor_s": [-1.0]}, "must be a finite number >= 0"),
        ({"estimates": [{**AT, "stamp_ns": 6}], "processor_s": [0.0]}, "answered for 6 ns"),
    ],
)
def test_what_a_program_says_at_the_end_is_judged(answer, words):
    with pytest.raises(SlamFailedError, match=words) as caught:
        protocol.at_end_of(answer, [5])
    assert caught.value.outcome == "bad"


def test_only_what_is_not_ours_is_put_behind_a_pipe():
    assert not isinstance(limited("odometry", Limits()), PipeSlam)
    assert not isinstance(limited("slam.odometry:OdometrySlam", None), PipeSlam)
    with pytest.raises(UnknownNameError):
        limited("shuntin", Limits())


def asked(server: Server, **message: object) -> dict[str, object]:
    return protocol.message_of(server.answer(protocol.line(message)))


def test_the_other_end_answers_whatever_it_is_told(stream):
    hello = protocol.hello_message()
    server = Server("slam.odometry:OdometrySlam", {})
    assert asked(server, type="reset")["message"] == "hello comes first"
    assert asked(server, **hello)["version"] == 1
    assert asked(server, type="frame")["outcome"] == "bad"
    assert asked(server, type="song")["outcome"] == "bad"
    said = protocol.message_of(server.answer(protocol.frame_line(stream[0], None)))
    assert said["stamp_ns"] == stream[0].stamp_ns
    assert asked(server, type="trajectory")["stamps_ns"] == [stream[0].stamp_ns]
    assert asked(server, type="reset")["type"] == "reset"
    assert asked(server, type="trajectory")["stamps_ns"] == []
    nowhere = asked(Server("not_there:X", {}), **hello)
    assert "cannot import 'not_there'" in str(nowhere["message"])
    assert "unexpected keyword" in str(asked(Server("odometry", {"x": 1}), **hello)["message"])
