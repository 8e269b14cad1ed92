# SPDX-License-Identifier: Apache-2.0
"""``mobilia generate --sessions``: the same bytes however made, and a truth that is of the bags."""

import csv
from pathlib import Path

import numpy as np
import pytest

from scripts.spec import command
from scripts.verbs.generate import Generate
from sim.recording.dataset import Plan, check_dataset, read_plan
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.tables import CHANGES, COLUMNS, FILES, REARRANGED, THINGS
from sim.recording.verify import check_hashes, regenerate
from slam.errors import InvalidValueError
from slam.logs.bag_topics import Bag

pytestmark = pytest.mark.slow
generate = command(Generate)

REPO = Path(__file__).resolve().parents[3]
N, CHANGE = 3, 0.4
NAMES = [f"office-d0.3-c0.4-s0002-session{k:02d}" for k in range(N)]
SETTINGS = {"dynamism": ["0.3"], "seconds": 0.6, "seed": 2, "scanner": "noise", "change": CHANGE}


def sums(out: Path) -> dict[str, bytes]:
    files = (p for p in out.rglob("*") if p.is_file() and not p.name.startswith("."))
    return {p.relative_to(out).as_posix(): p.read_bytes() for p in files}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("sessions") / "data"
    generate(["office"], out, sessions=N, **SETTINGS)
    return out


def test_one_episode_a_session_and_all_of_it_is_vouched_for(made):
    assert sorted(p.name for p in made.iterdir() if p.is_dir()) == NAMES
    assert [found.verdict for found in check_dataset(made)] == ["whole"] * (N + 1)
    assert regenerate(made / NAMES[2]).verdict == "same bytes"
    maps = {(folder / "map.pgm").read_bytes() for folder in (made, *map(made.joinpath, NAMES))}
    assert len(maps) == 1


def test_damage_to_the_truth_is_found_and_made_good(made, tmp_path):
    out = tmp_path / "data"
    for name, raw in sums(made).items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_bytes(raw)
    for name in FILES:
        (out / name).unlink()
        (whole, *episodes) = check_dataset(out)
        assert whole.verdict in ("damaged", "incomplete")
        assert name in whole.why
        assert {found.verdict for found in episodes} == {"whole"}
    (out / CHANGES).write_text("mine")
    generate(["office"], out, sessions=N, **SETTINGS)
    assert sums(out) == sums(made)


def things(folder):
    """(session, name) -> pose; None while out of the building."""
    rows = list(csv.DictReader((folder / THINGS).read_text().splitlines()))
    columns = ("x_m", "y_m", "heading_rad")
    poses = [None if row["x_m"] == "" else [float(row[c]) for c in columns] for row in rows]
    return {(int(r["session"]), r["name"]): p for r, p in zip(rows, poses, strict=True)}


def test_the_truth_is_where_things_are_in_the_bag(made):
    known = things(made)
    for session, name in enumerate(NAMES):
        poses = {thing: pose for (k, thing), pose in known.items() if k == session}
        with Bag(made / name) as bag:
            topic = "/ground_truth/objects"
            markers = next(message for _, _, message in bag.messages([topic])).markers
        told = {m.text: (m.pose.position.x, m.pose.position.y) for m in markers}
        for thing, pose in poses.items():
            if pose is None:
                assert told[thing][0] > 500.0
            elif not thing.startswith("door"):
                assert np.hypot(*np.subtract(told[thing], pose[:2])) < 0.05


def test_any_two_sessions_have_their_changes(made):
    rows = list(csv.DictReader((made / CHANGES).read_text().splitlines()))
    pairs = {(int(row["from_session"]), int(row["to_session"])) for row in rows}
    assert pairs == {(0, 1), (0, 2), (1, 2)}
    where, n = things(made), 38
    for row in rows:
        before = where[int(row["from_session"]), row["name"]]
        after = where[int(row["to_session"]), row["name"]]
        word = "new" if before is None else "gone" if after is None else row["change"]
        assert row["change"] == word
        assert (row["from_x_m"] == "") == (before is None)
        if row["change"] == "stayed":
            assert np.abs(np.subtract(before, after)).max() < 0.1
    for pair in ((0, 1), (1, 2)):
        told = [r for r in rows if (int(r["from_session"]), int(r["to_session"])) == pair]
        changed = sum(row["change"] != "stayed" for row in told)
        assert changed / n == pytest.approx(CHANGE, abs=0.05)


def test_what_changes_out_of_sight_during_an_episode_is_written_down(tmp_path):
    generate(["arena"], tmp_path / "data", **{**SETTINGS, "seconds": 9.0, "change": 1.0})
    (folder,) = (p for p in (tmp_path / "data").iterdir() if p.is_dir())
    (header, *rows) = csv.reader((folder / REARRANGED).read_text().splitlines())
    assert tuple(header) == COLUMNS
    assert rows
    assert all(0.0 < float(row[0]) < 9.0 for row in rows)
    assert check_hashes(folder).verdict == "whole"
    assert read_recipe(folder / RECIPE).recipe.change == 1.0


def test_sessions_are_of_one_building_and_a_plan_without_any_is_as_before(made):
    recipe = Recipe(scene="arena", seed=0, dynamism=0.5, seconds=1.0)
    for wrong in ({"episodes": 2}, {"twins": True}, {"dynamisms": (0.1, 0.2)}, {"sessions": -1}):
        with pytest.raises(InvalidValueError, match="sessions"):
            Plan(**{"recipe": recipe, "dynamisms": (0.5,), "episodes": 1, "sessions": 2, **wrong})
    assert "session" not in Plan(recipe=recipe, dynamisms=(0.5,), episodes=1).text()
    assert read_plan(made).sessions == N
