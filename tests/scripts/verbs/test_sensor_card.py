# SPDX-License-Identifier: Apache-2.0
"""Every row of the sensor card holds; the page and its pictures are written, and small."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from scripts.card import rows as sensor_rows
from scripts.card import stated
from scripts.verbs.sensor_card import sensor_card
from sim.sensors.lidar.sheet import NOT_STATED, sheet_of
from slam.errors import InvalidValueError, MobiliaError, UnknownNameError


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


@pytest.mark.parametrize("name", ["utm30lx", "tim561", "rplidar_a1"])
def test_every_row_of_another_scanner_agrees_with_its_data_sheet(name: str) -> None:
    rows, sheet = stated.rows_of(name), sheet_of(name)
    broken = [f"{row.what}: {row.measured}, not {row.datasheet}" for row in rows if not row.kept]
    assert not broken
    named = {row.what for row in sheet}
    assert {"field_of_view_deg", "step_deg", "rate_hz", "range_min_m", "range_max_m", "noise_m",
            "systematic_m", "unit_m", "beam_to_beam_us"} <= named  # fmt: skip
    for row in sheet:
        assert (row.value is None) == row.text.startswith(NOT_STATED)
        assert row.source or row.value is None
    assert f"| {rows[0].what} |" in stated.page(name, rows)


def test_a_card_can_be_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = [replace(row, value=50.0) for row in sheet_of("tim561") if row.what == "rate_hz"]
    monkeypatch.setattr(stated, "sheet_of", lambda name: wrong)
    assert [row.kept for row in stated.rows_of("tim561")] == [False]


@pytest.mark.parametrize("name", ["full", "utm30lx:noise", "lms221(resolution_deg=0.25)"])
def test_a_card_is_of_a_whole_model(name: str) -> None:
    with pytest.raises(InvalidValueError, match=r"a whole model, one of lms221, .*utm30lx; got"):
        sensor_card(scanner=name)


def test_a_scanner_without_a_data_sheet_has_no_card() -> None:
    with pytest.raises(InvalidValueError, match="'scanner' has no data sheet"):
        sensor_card(scanner="scanner")
    with pytest.raises(UnknownNameError, match="Did you mean 'tim561'"):
        sensor_card(scanner="tim562")
