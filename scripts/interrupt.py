# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C and kill: unwind everything, so that what is half-written is removed on the way."""

import atexit
import signal
from types import FrameType
from typing import NoReturn

LLVM = ("llvmlite.binding", "numba.core.codegen", "numba.core.serialize", "slam._numba")  # modules
_RETRY_S = 0.05  # s, until a signal that came while LLVM was at work is raised
_asked = False


class InterruptedBySignal(BaseException):
    """Not KeyboardInterrupt, which the command line library swallows without a word."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _asked
    again = _asked and number != signal.SIGALRM
    _asked = True
    if _within_llvm(frame) and not again:
        signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
        return
    _raise()


def _raise() -> NoReturn:
    """Once: the alarm of a signal that waits would raise again, in the middle of cleaning up."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    raise InterruptedBySignal


def _within_llvm(frame: FrameType | None) -> bool:
    """Whether LLVM is at work, or Numba hands code to it: an exception in a callback is lost, or
    what is half done ends the process with a segmentation fault."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(LLVM):
            return True
        frame = frame.f_back
    return False


def install() -> None:
    """From now on SIGINT, SIGTERM and SIGHUP raise ``InterruptedBySignal`` in the main thread.

    While LLVM is at work they wait for it; a second signal does not. SIGHUP, the end of the
    terminal, stays ignored where nohup has it so.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    signal.signal(signal.SIGALRM, _interrupt)
    # Python gives handlers up as it ends, but for what is ignored: an alarm would then kill it
    atexit.register(signal.signal, signal.SIGALRM, signal.SIG_IGN)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _interrupt)


def check() -> None:
    """Raise it again: an exception that hits a finaliser is lost."""
    if _asked:
        _raise()
