# SPDX-License-Identifier: Apache-2.0
"""A signal unwinds the command; one that is ignored on purpose stays so."""

from __future__ import annotations

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
