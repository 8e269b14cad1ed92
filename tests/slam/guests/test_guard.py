# SPDX-License-Identifier: Apache-2.0
"""Whatever a guest starts ends with it, in whatever session, however mobilia itself ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from slam.errors import SlamFailedError
from slam.guests.wire import Wire
from tests.processes import processes_with

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="orphans are only found on Linux"),
]

# Each starts a child that leaves its session and says its number.
DAEMON = """
import os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        print(os.getpid(), flush=True)
        for number in (0, 1, 2):
            os.close(number)
        time.sleep(300)
    os._exit(0)
os.wait()
time.sleep(300)
"""
HOPPING = """
import os, time
if os.fork() == 0:
    os.setsid()
    print(os.getpid(), flush=True)
    ends = time.monotonic() + 60.0  # should guard and test be killed together, nobody else ends it
    while time.monotonic() < ends:  # a process that is another one a moment later
        if os.fork():
            os._exit(0)
    os._exit(0)
time.sleep(300)
"""
AWAY = {
    "setsid": ["sh", "-c", 'setsid sh -c "echo \\$\\$; exec sleep 300" & sleep 300'],
    "orphan": ["sh", "-c", '(setsid sh -c "echo \\$\\$; exec sleep 300" &); trap "" TERM; sleep 9'],
    "daemon": [sys.executable, "-S", "-E", "-c", DAEMON],
    "hopping": [sys.executable, "-S", "-E", "-c", HOPPING],
}
MARK = "MOBILIA_TEST_GUARD"


def none_left(mark: str) -> float:
    """Seconds until none is left; after 10 it fails."""
    started = time.monotonic()
    while left := processes_with(MARK, mark):
        assert time.monotonic() - started < 10.0, left
        time.sleep(0.01)
    return time.monotonic() - started


@pytest.mark.parametrize("kind", AWAY)
def test_a_child_in_another_session_ends_when_the_guest_is_closed(kind):
    other = subprocess.Popen(["sleep", "300"], start_new_session=True)
    try:
        wire = Wire(AWAY[kind], {**os.environ, MARK: f"closed {kind}"})
        child = int(wire.ask(b"", 10.0))
        assert os.getsid(wire.pid) == wire.pid
        if kind != "hopping":
            assert os.getsid(child) != wire.pid
        wire.close()
        none_left(f"closed {kind}")
        assert other.poll() is None  # nobody else is touched
    finally:
        other.kill()
        other.wait()


def start_and_wait(kind: str) -> None:
    """What the program of the next test does; mobilia's stand-in."""
    wire = Wire(AWAY[kind], {**os.environ, MARK: f"killed {kind}"})
    print(int(wire.ask(b"", 10.0)), flush=True)
    time.sleep(300)


@pytest.mark.parametrize("kind", AWAY)
def test_a_child_in_another_session_ends_when_mobilia_is_killed(kind):
    code = f"from tests.slam.guests.test_guard import start_and_wait; start_and_wait({kind!r})"
    repository = Path(__file__).resolve().parents[3]
    mobilia = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        cwd=repository,
        env={**os.environ, MARK: f"killed {kind}"},  # its guard inherits it
    )
    with mobilia:
        assert int(mobilia.stdout.readline()) > 0
        assert len(processes_with(MARK, f"killed {kind}")) >= 3
        mobilia.kill()
    print(f"{kind}: {none_left(f'killed {kind}'):.3f} s")


def test_a_child_in_another_session_ends_when_the_guest_has_ended_by_itself():
    words = "setsid sleep 300 >/dev/null 2>&1 & exit 3"
    wire = Wire(["sh", "-c", words], {**os.environ, MARK: "ended"})
    with pytest.raises(SlamFailedError, match="its process ended with status 3"):
        wire.ask(b"", 10.0)
    none_left("ended")


def test_a_guest_ends_when_its_guard_is_killed():
    wire = Wire(["sh", "-c", "echo 1; exec sleep 300"], {**os.environ, MARK: "unguarded"})
    assert wire.ask(b"", 10.0) == b"1"
    os.kill(wire._guard.process.pid, signal.SIGKILL)
    with pytest.raises(SlamFailedError, match="was ended with its guard"):
        wire.ask(b"", 10.0)
    none_left("unguarded")


def test_signals_to_its_guard_are_for_mobilia_to_decide():
    wire = Wire(["sh", "-c", "while read -r x; do echo $x; done"])
    assert wire.ask(b"1\n", 10.0) == b"1"
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(wire._guard.process.pid, number)
    assert wire.ask(b"2\n", 10.0) == b"2"
    wire.close()


def test_a_guest_gets_its_environment_and_signals_as_they_are():
    odd = os.fsdecode(b"\xff")
    wire = Wire(["/usr/bin/env"], {"ODD": odd})
    assert wire.ask(b"", 10.0) == b"ODD=\xff"
    with pytest.raises(SlamFailedError, match="ended with status 0"):  # no other variable
        wire.ask(b"", 10.0)
    wire = Wire(["sh", "-c", "grep SigIgn /proc/self/status"])
    ignored = int(wire.ask(b"", 10.0).split()[1], 16)
    assert not ignored & (1 << signal.SIGPIPE - 1 | 1 << signal.SIGTERM - 1)
    wire.close()
