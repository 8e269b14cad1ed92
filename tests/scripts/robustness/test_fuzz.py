# SPDX-License-Identifier: Apache-2.0
"""Readers of damaged files succeed or raise our own errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scripts.robustness.fuzz import Sample, attack, corpus, damaged
from scripts.robustness.fuzz_calls import GROUPS, Tally, run
from scripts.robustness.fuzz_frames import frames


@pytest.fixture(scope="module")
def samples(tmp_path_factory) -> list[Sample]:
    return corpus(tmp_path_factory.mktemp("corpus"))


def test_sound_files_are_read(samples, tmp_path):
    for sample in samples:
        (tmp_path / sample.name).write_bytes(sample.data)
        sample.read(tmp_path / sample.name)


def test_damaged_files_never_raise_anything_but_our_errors(samples, tmp_path: Path):
    rng = np.random.default_rng(2)
    outcomes = []
    for _ in range(40):
        for sample in samples:
            outcome, details = attack(sample, tmp_path, rng)
            assert outcome != "FINDING", f"{sample.name}: {details}"
            outcomes.append(outcome)
    assert {"read", "refused"} == set(outcomes)


def test_the_same_seed_does_the_same_damage(samples):
    once, again = (damaged(samples[0].data, np.random.default_rng(5)) for _ in range(2))
    assert once == again != samples[0].data


@pytest.mark.parametrize("group", list(GROUPS))
def test_odd_calls_raise_nothing_but_our_errors(group):
    """``python -m scripts.robustness.fuzz --cases 500`` goes on for longer."""
    whole = Tally()
    for number in range(16):
        whole.add(run(group, number, seed=3))
    assert whole.findings == []
    assert whole.answered > 0
    assert whole.refused > 0


def test_the_same_seed_makes_the_same_calls():
    def odd() -> list:
        rng = np.random.default_rng(4)
        return [frame for _ in range(5) for frame in frames(rng)]

    assert odd() == odd()
