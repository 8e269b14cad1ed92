# SPDX-License-Identifier: Apache-2.0
"""Every row of the sensor card holds; the page and its pictures are written, and small."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.card import rows as sensor_rows
from scripts.verbs.sensor_card import sensor_card
from slam.errors import MobiliaError


@pytest.mark.parametrize(
    ("part", "count"),
    [("modes", 6), ("timing", 2), ("noise", 8), ("systematic", 2), ("spot", 7),
     ("reflectivity", 14), ("codes", 4), ("link", 3)],
)  # fmt: skip
def test_every_row_agrees_with_the_data_sheet(part: str, count: int) -> None:
    rows = list(getattr(sensor_rows, part)())
    assert len(rows) == count
    broken = [f"{row.what}: {row.measured}, not {row.datasheet}" for row in rows if not row.kept]
    assert not broken


def test_the_card_is_a_page_with_two_small_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensor_rows, "rows", lambda: list(sensor_rows.timing()))
    sensor_card(out=tmp_path)
    page = (tmp_path / "sensor_card.md").read_text()
    assert "| ✓ | time per degree of the mirror | 37.0 µs" in page
    for name in ("sensor_card", "sensor_ablation"):
        picture = tmp_path / "pictures" / f"{name}.png"
        assert f"pictures/{name}.png" in page
        assert 20_000 < picture.stat().st_size <= 250_000


def test_a_row_that_does_not_hold_fails_the_card(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = sensor_rows.Row(
        what="colour", datasheet="blue", measured="red", source="TD p1", kept=False
    )
    monkeypatch.setattr(sensor_rows, "rows", lambda: [broken])
    with pytest.raises(MobiliaError, match="departs from its data sheet: colour"):
        sensor_card()
