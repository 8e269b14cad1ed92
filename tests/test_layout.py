# SPDX-License-Identifier: Apache-2.0
"""Each row of docs/layout.md leads to what it names."""

import re
from pathlib import Path

import pytest

from slam.system import OWN

ROOT = Path(__file__).resolve().parents[1]
ROWS = [
    line.strip("|").split("|")
    for line in (ROOT / "docs/layout.md").read_text().splitlines()
    if line.startswith("| ") and "`" in line.split("|")[2]
]


def places(cell: str, row: str) -> list[Path]:
    """Paths of a cell; a bare name lies beside the one before it, or in the table's folder."""
    folder, found = ROOT / "scripts/paper", []
    for name in re.findall(r"`([^`]+)`", cell):
        beside = folder / name
        path = ROOT / name if (ROOT / name).exists() or "/" in name.rstrip("/") else beside
        assert path.exists(), f"{row}: no {name}"
        folder = path.parent
        found.append(path)
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip()[:40])
def test_what_a_row_names_is_there_and_defined(row: list[str]) -> None:
    what, where = row[0], row[1]
    files = [
        file
        for path in places(where, what)
        for file in ([path] if path.is_file() else path.rglob("*"))
        if file.suffix in (".py", ".yml")
    ]
    text = "\n".join(f"{file.stem}\n{file.read_text()}" for file in files)
    wanted = re.findall(r"`(?:mobilia )?([a-z_-]+)`", what)  # a SLAM, a verb, a name in the code
    wanted += [f"({number})" for number in re.findall(r"\((\d+)\)", what) if "Eq" in what]
    verbs = {file.stem for file in (ROOT / "scripts/verbs").glob("*.py")}
    for word in {word.replace("-", "_") for word in wanted} - set(OWN) - verbs:
        assert word in text.replace("-", "_"), f"{what}: no {word} in {where}"
