# SPDX-License-Identifier: Apache-2.0
"""What is called a gain on fresh seeds, and how often where there is none."""

import random

from scripts.tuning.verdict import judge

Run = tuple[bool, float]


def rows(slam: str, runs: list[Run]) -> list[dict]:
    return [
        {"slam": slam, "seed": seed, "lost": int(lost), "ate_unaligned_m": error,
         "outcome": "lost" if lost else "finished"}
        for seed, (lost, error) in enumerate(runs)
    ]  # fmt: skip


def verdict(before: list[Run], after: list[Run]):
    return judge(rows("a", before) + rows("b", after), "a", "b")


LOST, HELD = (True, 3.0), (False, 0.1)


def test_runs_saved_are_a_gain_where_the_sign_test_says_so():
    found = verdict([LOST] * 9 + [HELD] * 11, [LOST] * 1 + [HELD] * 19)
    assert (found.gain, found.lost) == ("lost", (9, 1))
    assert found.of_lost["p_sign"] == 2 * 0.5**8
    said = "Lost in 1 (95 %: 1 to 24 %) of 20 fresh runs instead of 9 (95 %: 26 to 66 %): 8 saved"
    assert found.sentence.startswith(said)


def test_six_runs_saved_are_none_for_two_questions_are_asked():
    found = verdict([LOST] * 6 + [HELD] * 14, [HELD] * 20)
    assert found.gain == ""
    assert found.sentence.startswith("No gain that fresh seeds confirm: lost in 0 ")


def test_a_smaller_error_is_a_gain_unless_more_is_lost():
    better = [(False, 0.05)] * 20
    assert verdict([HELD] * 20, better).gain == "error"
    assert verdict([HELD] * 20, [*better[:18], LOST, LOST]).gain == ""
    assert "50 % lower (95 %: 50 to 50 %)" in verdict([HELD] * 20, better).sentence


def test_nothing_held_and_failed_runs_are_judged_too():
    failed = [{"slam": "a", "seed": k, "lost": 1, "ate_unaligned_m": None, "outcome": "raised"}
              for k in range(8)]  # fmt: skip
    found = judge(failed + rows("b", [HELD] * 8), "a", "b")
    assert (found.gain, found.of_error["n"]) == ("lost", 0)
    few = [*[LOST] * 8, *[HELD] * 6]
    assert verdict(few, few).sentence.endswith("0 saved, 0 lost anew (p = 1).")
    assert "where both hold" in verdict([*few, HELD], [*few, HELD]).sentence


def test_equals_are_called_a_gain_in_one_of_twenty_at_most():
    draw = random.Random(4)

    def runs() -> list[Run]:
        return [(draw.random() < 0.4, draw.lognormvariate(-2.0, 0.6)) for _ in range(20)]

    gains = sum(verdict(runs(), runs()).gain != "" for _ in range(300))
    assert gains <= 15  # 5 %, of both questions together
