# SPDX-License-Identifier: Apache-2.0
"""A signal unwinds the command; one that is ignored on purpose stays so."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
CODE = (
    "import time; from scripts import interrupt\n"
    "interrupt.install()\n"
    "try:\n"
    "    print('ready', flush=True)\n"
    "    time.sleep(float({seconds}))\n"
    "    print('undisturbed')\n"
    "except interrupt.InterruptedBySignal:\n"
    "    print('unwound')\n"
)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_unwinds(number):
    assert said_after(number, [sys.executable, "-c", CODE.format(seconds=60)]) == "unwound"


COMPILING = """
import time
from scripts import interrupt

interrupt.install()
at_work = {"__name__": "llvmlite.binding.ffi", "time": time}
try:
    exec(
        "print('ready', flush=True)\\n"
        "end = time.monotonic() + 1.0\\n"
        "while time.monotonic() < end: time.sleep(0.01)\\n"
        "print('compiled', flush=True)",
        at_work,
    )
    time.sleep(60)
except interrupt.InterruptedBySignal:
    print("unwound")
"""


def test_a_signal_waits_for_llvm():
    words = [sys.executable, "-c", COMPILING]
    assert said_after(signal.SIGTERM, words) == "compiled\nunwound"


WAITING = """
import signal, time
from scripts import interrupt

interrupt.install()
exec("signal.raise_signal(signal.SIGTERM)", {"__name__": "llvmlite.binding.ffi", "signal": signal})
try:
    if SEEN_AT_ONCE:
        interrupt.check()
    time.sleep(60)
except interrupt.InterruptedBySignal:
    print("unwound", signal.getitimer(signal.ITIMER_REAL))
"""


@pytest.mark.parametrize("seen_at_once", [True, False])
def test_a_signal_that_waited_is_raised_once(seen_at_once: bool):
    words = [sys.executable, "-c", WAITING.replace("SEEN_AT_ONCE", str(seen_at_once))]
    done = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == ("unwound (0.0, 0.0)\n", 0), done.stderr


ENDING = """
import builtins, signal
from scripts import interrupt

class Last:
    def __del__(self, kill=signal.raise_signal, number=signal.SIGALRM):
        kill(number)  # after Python has given up its handlers

interrupt.install()
builtins.last = Last()
print("ended", flush=True)
"""


def test_an_alarm_does_not_kill_a_command_that_ends():
    done = subprocess.run([sys.executable, "-c", ENDING], cwd=REPO, capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("ended\n", 0), done.stderr


BOXING = """
import signal, sys
from collections import namedtuple
import numba
from scripts import interrupt

kernel = numba.njit(lambda x: PAIR(x, x))
PAIR = namedtuple("PAIR", "a b")
kernel(1.0)
interrupt.install()

def once(frame, event, argument):
    if frame.f_code.co_name == "_numba_unpickle":
        sys.setprofile(None)
        signal.raise_signal(signal.SIGTERM)

try:
    sys.setprofile(once)
    while True:
        kernel(1.0)
except interrupt.InterruptedBySignal:
    print("unwound")
"""


def test_a_signal_waits_until_python_has_a_kernel_s_answer():
    """Numba asks Python for the class of a named tuple, and calls whatever it got."""
    words = [sys.executable, "-c", BOXING]
    done = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=60)
    assert done.stdout == "unwound\n", done.stderr


def test_the_end_of_the_terminal_is_ignored_under_nohup():
    words = ["nohup", sys.executable, "-c", CODE.format(seconds=0.5)]
    assert said_after(signal.SIGHUP, words) == "undisturbed"


def said_after(number: signal.Signals, words: list[str]) -> str:
    with subprocess.Popen(
        words, cwd=REPO, env={**os.environ, "PYTHONPATH": str(REPO)},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        preexec_fn=_heeding,
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)
        return process.stdout.read().strip()


def _heeding() -> None:
    """As in a terminal: SIGINT is ignored after "&", SIGHUP under nohup."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
