# SPDX-License-Identifier: Apache-2.0
"""Verbs stand above everything else in ``scripts``: nothing that they use imports one."""

from __future__ import annotations

import ast
from pathlib import Path

SCRIPTS = Path(__file__).parents[2] / "scripts"
ABOVE = {"cli.py", "verbs", "robustness"}  # the last of them tries whole commands


def test_only_the_command_line_imports_verbs():
    for path in SCRIPTS.rglob("*.py"):
        if path.relative_to(SCRIPTS).parts[0] in ABOVE:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = getattr(node, "module", None) if isinstance(node, ast.ImportFrom) else None
            assert not (found or "").startswith("scripts.verbs"), path
