# SPDX-License-Identifier: Apache-2.0
"""Every row of the sensor card holds; the page and its pictures are written, and small.

Beside a real log, simulated scans are measured by the same code.
"""

from pathlib import Path

import numpy as np
import pytest

from scripts.card import beside, stated
from scripts.card import rows as sensor_rows
from scripts.card.beside import simulated
from scripts.card.page import page, table
from scripts.card.rows import Row
from scripts.spec import command
from scripts.verbs.sensor_card import SensorCard
from sim.sensors.lidar.registry import scanner_of
from sim.sensors.lidar.sheet import NOT_STATED, sheet_of
from slam.errors import MobiliaError
from slam.evaluation.scanner.card import ScannerCard, measure

pytestmark = pytest.mark.slow
sensor_card = command(SensorCard)


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


def test_the_card_is_a_page_with_a_small_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensor_rows, "rows", lambda: list(sensor_rows.timing()))
    sensor_card(out=tmp_path)
    page = (tmp_path / "sensor_card.md").read_text()
    assert "| ✓ | time per degree of the mirror | 37.0 µs" in page
    assert "pictures/sensor_ablation.png" in page
    picture = tmp_path / "pictures" / "sensor_ablation.png"
    assert 20_000 < picture.stat().st_size <= 250_000


def test_a_row_that_does_not_hold_fails_the_card(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = Row(what="colour", datasheet="blue", measured="red", source="TD p1", kept=False)
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
    assert f"| {rows[0].what} |" in page(name, table(name, rows))


# -- beside real logs -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cards() -> dict[str, ScannerCard]:
    """Of the LMS-221 as its data sheet has it, and with less noise, in one small scene."""
    made = {}
    for noise_m in (0.010, 0.0047):
        scanner = scanner_of("lms221", resolution_deg=1.0, noise_m=noise_m)
        small = simulated(scanner, scenes=("arena",), places=9, driven_s=3.0)
        made[f"{noise_m:g}"] = measure(small)
    return made


def test_our_scanner_measured_like_a_log_has_the_noise_it_is_given(
    cards: dict[str, ScannerCard],
) -> None:
    """Of 10 mm with two roundings, the flicker shows one: 9.6 mm, as on the sensor card."""
    usual, less = cards["0.01"], cards["0.0047"]
    assert usual.standing_stretches >= 9
    assert usual.blocks >= 1
    assert usual.figures["step"].value == 0.01
    assert usual.figures["standing.square"].value == pytest.approx(0.0096, rel=0.06)
    analog = 0.0047**2 - 2 * 0.01**2 / 12
    assert less.figures["standing.square"].value == pytest.approx(
        (analog + 0.01**2 / 12) ** 0.5, rel=0.06
    )
    assert usual.figures["standing.square"].value > 2 * less.figures["standing.square"].value


def test_cards_side_by_side_as_table_and_picture(
    cards: dict[str, ScannerCard], tmp_path: Path
) -> None:
    less, ours = {"less": cards["0.0047"]}, {"usual": cards["0.01"]}
    text = beside.markdown(less, ours).splitlines()
    (row,) = (line for line in text if line.startswith("| noise of a standing robot |"))
    assert f"| {beside.DIFFERS} |" in row
    assert not any("range, 2 to 4 m" in line for line in text)
    assert any("2 to 4 m" in row[0].text for row in beside.table(less, ours).rows)
    verdicts = {row[3].text for row in beside.table({"again": cards["0.01"]}, ours).rows}
    assert verdicts <= {"", beside.AGREES}
    beside.draw(tmp_path / "cards.png", less, ours)
    assert (tmp_path / "cards.png").stat().st_size > 20_000


def flaser(path: Path) -> Path:
    """A CARMEN log of a robot that stands before a wall, in four places, with 5 mm of noise."""
    rng, lines = np.random.default_rng(0), []
    angles = np.deg2rad(np.arange(180) - 90.0)
    for k in range(48):
        place = 2.0 + k // 12
        ranges = np.minimum(place / np.maximum(np.cos(angles), 1e-3), 20.0)
        sent = np.round(ranges + 0.005 * rng.standard_normal(180), 2)
        pose = f"{k // 12}.0 0.0 0.0"
        words = " ".join(f"{r:.2f}" for r in sent)
        lines.append(f"FLASER 180 {words} {pose} {pose} {0.2 * k:.1f} robot {0.2 * k:.1f}\n")
    path.write_text("".join(lines))
    return path


def test_a_log_beside_simulated_scans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    cards: dict[str, ScannerCard],
) -> None:  # fmt: skip
    monkeypatch.setenv("COLUMNS", "200")
    asked = []
    monkeypatch.setattr(beside, "simulated_card", lambda name: asked.append(name) or cards["0.01"])
    sensor_card(log=[flaser(tmp_path / "robot.log")], out=tmp_path / "out")
    assert asked == ["lms221(resolution_deg=1)"]
    page = (tmp_path / "out" / "real_scanner_log.md").read_text()
    table = (tmp_path / "out" / "results" / "real_scanner_log.csv").read_text()
    (row,) = (line for line in table.splitlines() if line.startswith("noise of a standing robot,"))
    value = float(row.split(",")[2].split("(")[0])
    assert value == pytest.approx((5.0**2 + 10.0**2 / 12) ** 0.5, rel=0.08)
    assert beside.DIFFERS in row
    assert "4 standing stretches (40 scans)" in page
    sensor_card(log=[tmp_path / "robot.log"], scanner="tim561")
    assert asked[-1] == "tim561"
