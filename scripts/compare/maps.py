# SPDX-License-Identifier: Apache-2.0
"""How well a map tells what is there now, judged against the simulation while it is being made."""

from __future__ import annotations

from typing import Any

from scripts.compare.recording import Recording
from slam.system import Raster


class MapJudge:
    """Thin for now."""

    def __init__(self, drive: Recording) -> None:
        self.drive = drive

    def look(self, k: int) -> None:
        """Scan k."""

    def wants(self, k: int) -> bool:
        """Whether the map after scan k is wanted."""
        return False

    def judge(self, k: int, raster: Raster | None) -> None:
        """Score it."""

    def scores(self) -> dict[str, Any]:
        """Columns ``MAPS``."""
        return {}
