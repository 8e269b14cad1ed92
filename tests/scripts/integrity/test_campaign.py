# SPDX-License-Identifier: Apache-2.0
"""A campaign has as many losses as asked for, goes on where it was stopped, and tells the truth."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scripts.integrity import campaign, losses, ways
from scripts.integrity.campaign import summary
from scripts.integrity.ways import EACH, WAYS, Case, cases
from slam.errors import InvalidValueError
from slam.odometry import OdometrySlam

pytestmark = pytest.mark.slow
WORDS = ["--ways", "chairs", "corridor", "--slams", "odometry", "--losses", "2", "--no-page"]


def words(folder: Path, *more: str) -> list[str]:
    results = ["--seconds", "3", "--results", str(folder / "integrity.json")]
    return [*WORDS, "--folder", str(folder / "cases"), *results, *more]


def case(way: str, number: int = 0, slam: str = "odometry", first_seed: int = 100) -> Case:
    return Case(way=way, number=number, slam=slam, first_seed=first_seed, seconds=8.0)


def test_every_way_gets_its_losses_in_turn():
    plan = list(cases(list(WAYS), ["a", "b"], 12, 100, 60.0, [Path("x.log"), Path("y.log")]))
    for name, way in WAYS.items():
        own = [one for one in plan if (one.way, one.slam) == (name, "a")]
        assert len(own) * way.each >= 12 > (len(own) - 1) * way.each
    assert [one.log for one in plan if one.way == "log"][::2] == ["x.log", "y.log", "x.log"]
    assert {one.way for one in plan[: 2 * len(WAYS)]} == set(WAYS)
    assert not list(cases(["log"], ["a"], 12, 100, 60.0))
    with pytest.raises(InvalidValueError, match="--ways must be of chairs"):
        list(cases(["boats"], ["a"], 1, 1, 1.0))


def test_no_two_cases_share_a_stream():
    plan = cases(list(WAYS), ["a"], 300, 100, 60.0)
    specs = [one.spec for one in plan]
    assert len(set(specs)) == len(specs)
    kept = {spec.settings.layout for spec in specs if spec.seconds == ways.MAPPED_S}
    assert kept == set(ways.DECIDABLE)


def test_what_was_done_is_not_done_again(tmp_path, monkeypatch, capsys):
    assert campaign.campaign(words(tmp_path)) == 0
    told = capsys.readouterr().out
    files = sorted((tmp_path / "cases").glob("*.json"))
    assert [path.name[:-16] for path in files] == [
        f"odometry-{way}-00000{k}" for way in ("chairs", "corridor") for k in (0, 1)
    ]
    files[1].unlink()  # as if it had been killed before
    files[2].write_text("{")  # or something else was there
    done, run = [], losses.run
    monkeypatch.setattr(losses, "run", lambda one: done.append(one) or run(one))
    assert campaign.campaign(words(tmp_path)) == 0
    assert [(one.way, one.number) for one in done] == [("corridor", 0), ("chairs", 1)]
    assert told.count("| chairs | 2 |") == 1
    assert told.count("| chairs |") == 3  # a row in each table
    assert "| chairs | 2 |" in capsys.readouterr().out
    found = json.loads((tmp_path / "integrity.json").read_text())
    assert found["found"]["odometry all"]["losses"] == 4
    assert found["command"].startswith("python -m scripts.integrity.campaign --ways chairs")


def test_a_case_gives_the_same_numbers_twice():
    first, second = (losses.run(case("boards")) for _ in range(2))
    for row in (first, second):
        for part in (row["drive"], *row["losses"]):
            for key in ("ms", "max_ms"):
                part.pop(key, None)
    assert first == second
    assert first["losses"][0]["event"] == ""


@pytest.fixture
def short_tours(monkeypatch):
    monkeypatch.setattr(ways, "MAPPED_S", 40.0)


def test_who_never_doubts_takes_a_wrong_place_at_every_kidnap(short_tours):
    first_seed = 103 - ways.APART * list(WAYS).index("kidnap") % 4  # its odometry is "good"
    one = case("kidnap", first_seed=first_seed)
    assert one.spec.settings.odometry == "good"
    row = losses.run(one)
    assert row["drive"]["hazardous"] == 0
    assert len(row["losses"]) == EACH
    for loss in row["losses"]:
        assert math.isinf(loss["recovered_s"])
        assert loss["moved_m"] > 0.0
        far = loss["moved_m"] > 3.0
        assert (loss["wrong_places"] == 1 and loss["hazardous"] > 0) or not far
    found = summary([row])
    assert (found["losses"], found["not_recovered"]) == (EACH, EACH)
    assert found["hazardous"] >= sum(loss["moved_m"] > 3.0 for loss in row["losses"])


class Faulty(OdometrySlam):
    """Trusts nothing after 2 s, or raises then; stands where it was displaced to."""

    fails, by = False, np.zeros(3)

    def displace(self, by):
        self.by = by

    def update(self, frame):
        late = frame.stamp_ns >= 2_000_000_000
        if late and self.fails:
            raise ValueError("no more")
        estimate = super().update(frame)
        return replace(estimate, T_map_robot=estimate.T_map_robot + self.by, converged=not late)


def test_a_push_is_undone_or_counted(monkeypatch):
    monkeypatch.setattr(losses, "create", lambda name: Faulty())
    monkeypatch.setattr(losses.kidnap, "AFTER_S", 1.0)
    monkeypatch.setattr(losses, "PUSHED", (0.0, 0.2))  # while it trusts its poses
    row = losses.run(case("push"))
    assert [loss["event"] for loss in row["losses"]].count("push m") in (2, 3)
    assert all(math.isinf(loss["recovered_s"]) for loss in row["losses"])  # odometry never can
