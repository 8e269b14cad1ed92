# SPDX-License-Identifier: Apache-2.0
"""Peak memory of what runs in this process, from the kernel's own high-water mark (Linux)."""

from __future__ import annotations

import ctypes
import gc
import math
from pathlib import Path

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class PeakMemory:
    """Growth of the process's resident memory over what it was at the start, at its highest.

    Between ``begin`` and ``end`` the high-water mark counts, elsewhere nothing: what a comparison
    itself holds for a moment is left out, what it keeps is not. NaN where the kernel does not say.
    """

    def __init__(self) -> None:
        gc.collect()
        _give_back()
        self._base_kb = reading_kb("VmRSS")
        self._peak_kb = self._base_kb

    def begin(self) -> None:
        """Forget the peak so far."""
        if not forget_peak():
            self._peak_kb = math.nan

    def end(self) -> None:
        """Note the peak since ``begin``."""
        self._peak_kb = max(self._peak_kb, reading_kb("VmHWM"))  # NaN stays: it compares False

    @property
    def growth_mb(self) -> float:
        """MB (1e6 bytes)."""
        return (self._peak_kb - self._base_kb) * 1024.0 / 1e6


def _give_back() -> None:
    """Return freed memory to the system, so that the next one's growth shows."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError):  # another C library
        return


def forget_peak() -> bool:
    """From now on the process's peak is what is held now; whether the kernel can do that."""
    try:
        _CLEAR.write_text("5")  # proc(5)
    except OSError:
        return False
    return True


def reading_kb(name: str) -> float:
    """A line of this process's status file, "VmRSS" or "VmHWM", kB; NaN without one."""
    try:
        for line in _STATUS.read_text().splitlines():
            if line.startswith(name + ":"):
                return float(line.split()[1])
    except OSError:
        pass
    return math.nan
