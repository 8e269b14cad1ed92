# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C and kill: unwind everything, so that what is half-written is removed on the way."""

from __future__ import annotations

import signal
from types import FrameType

_asked = False


class InterruptedBySignal(BaseException):
    """Not KeyboardInterrupt, which the command line library swallows without a word."""


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    global _asked
    _asked = True
    raise InterruptedBySignal


def install() -> None:
    """From now on SIGINT, SIGTERM and SIGHUP raise ``InterruptedBySignal`` in the main thread.

    SIGHUP, the end of the terminal, stays ignored where nohup has it so.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _interrupt)


def check() -> None:
    """Raise it again: an exception that hits a callback of the compiler or a finaliser is lost."""
    if _asked:
        raise InterruptedBySignal
