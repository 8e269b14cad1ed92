# SPDX-License-Identifier: Apache-2.0
"""Which SLAMs take part where none is named: all that are installed."""

from __future__ import annotations

from slam import system
from slam.errors import MissingDependencyError

# A control; and one that runs on corners of the paper's kind, not on scans.
_NOT_BY_THEMSELVES = ("odometry", "shunting-features")


def installed() -> tuple[tuple[str, ...], dict[str, str]]:
    """The names of those that can run here; of each of the others, why it cannot."""
    there: list[str] = []
    missing: dict[str, str] = {}
    for name in system.names():
        if name in _NOT_BY_THEMSELVES:
            continue
        try:
            system.create(name)
            there.append(name)
        except MissingDependencyError as error:
            missing[name] = str(error).partition("\n")[0]
    return tuple(there), missing
