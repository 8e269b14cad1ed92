# SPDX-License-Identifier: Apache-2.0
"""Output of compiled code is dropped, and only that."""

from __future__ import annotations

import ctypes
import os

import pytest

from slam.guests.genz import quiet


def test_what_is_written_within_is_dropped_and_nothing_else(capfd: pytest.CaptureFixture[str]):
    libc = ctypes.CDLL(None)
    open_before = set(os.listdir("/dev/fd"))
    libc.puts(b"before")  # C keeps it for later
    with quiet():
        libc.puts(b"within, kept")
        os.write(1, b"within\n")
    libc.puts(b"between")
    with pytest.raises(ZeroDivisionError), quiet():
        libc.puts(b"within, kept") / 0
    libc.puts(b"after")
    libc.fflush(None)
    assert capfd.readouterr().out == "before\nbetween\nafter\n"
    assert set(os.listdir("/dev/fd")) == open_before
