# SPDX-License-Identifier: Apache-2.0
"""Which processes a test has started, and their children, wherever these went."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path


def processes_with(name: str, mark: str) -> list[int]:
    """Processes with ``name=mark`` in their environment that are not over."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"{name}={mark}".encode() in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
    return found
