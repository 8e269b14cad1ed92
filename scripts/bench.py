# SPDX-License-Identifier: Apache-2.0
"""``mobilia bench``: speed figures of this machine."""

from __future__ import annotations


def bench() -> None:
    """Measure the speed of simulation, scanner and SLAM on this machine."""
