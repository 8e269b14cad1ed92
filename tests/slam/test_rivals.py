# SPDX-License-Identifier: Apache-2.0
"""SLAMs that are compared share no code of each other's: what is shared is nobody's."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

SLAM = Path(__file__).parents[2] / "slam"
RIVALS = ("shunting", "ekf", "grid", "guests")
SHARED = ("tracker", "frontend", "landmarks", "evaluation")


def imported(folder: str) -> set[str]:
    """Modules that the files of a folder import."""
    found: set[str] = set()
    for path in (SLAM / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("folder", RIVALS + SHARED)
def test_no_folder_imports_a_slam_of_another(folder: str) -> None:
    assert (SLAM / folder / "__init__.py").exists()
    others = tuple(f"slam.{rival}." for rival in RIVALS if rival != folder)
    assert [name for name in sorted(imported(folder)) if f"{name}.".startswith(others)] == []
