# SPDX-License-Identifier: Apache-2.0
"""Readers of damaged files succeed or raise our own errors; ``scripts.fuzz`` goes on for longer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scripts.fuzz import Sample, attack, corpus, damaged


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
