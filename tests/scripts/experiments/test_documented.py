# SPDX-License-Identifier: Apache-2.0
"""Every experiment has its line in docs/experiments.md, and every line its experiment; every module
of experiments and of the paper is named on a page."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_every_experiment_has_a_line():
    page = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| `(\w+)` \|", page, flags=re.MULTILINE))
    there = {
        path.stem
        for path in (ROOT / "scripts" / "experiments").glob("*.py")
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
    }
    assert listed == there
    for link in re.findall(r"\]\((\w+\.md)\)", page):
        assert (ROOT / "docs" / link).is_file(), link


def test_every_module_is_named_on_a_page():
    pages = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs").rglob("*.md"))
    for folder in ("experiments", "paper"):
        for path in (ROOT / "scripts" / folder).glob("[!_]*.py"):
            assert f"{path.name}`" in pages or f"| `{path.stem}` |" in pages, path
