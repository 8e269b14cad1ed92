# SPDX-License-Identifier: Apache-2.0
"""Drives to learn from: to the goal, the same again in the environment, the same from Minari."""

import json
import shutil

import gymnasium
import numpy as np
import pytest

from scripts.spec import command
from scripts.verbs.generate import Generate
from sim.gym import offline
from sim.recording.dataset import check_dataset
from sim.recording.recipe import Recipe
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow
RECIPE = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=30.0)


@pytest.fixture(scope="module")
def drive() -> offline.Drive:
    return offline.driven(RECIPE)


def test_the_driver_reaches_its_goal(drive):
    assert drive.terminations.tolist() == [False] * (len(drive.rewards) - 1) + [True]
    assert not drive.truncations.any()
    assert drive.infos["is_success"].tolist() == [False] * len(drive.rewards) + [True]
    assert not drive.infos["hard_collision"].any()
    assert drive.rewards.sum() > 10.0
    assert np.abs(drive.actions).max() <= 1.0


def same(seen, drive, k):
    for name, values in drive.observations.items():
        np.testing.assert_array_equal(seen[name], values[k])


def test_its_actions_do_the_same_in_the_environment(drive):
    env = gymnasium.make(offline.spec_of(RECIPE))
    seen, info = env.reset(seed=drive.seed)
    same(seen, drive, 0)
    for k, action in enumerate(drive.actions, 1):
        seen, reward, terminated, _, info = env.step(action)
        same(seen, drive, k)
        assert (reward, terminated) == (drive.rewards[k - 1], drive.terminations[k - 1])
        np.testing.assert_array_equal(info["pose"], drive.infos["pose"][k])


def test_what_no_environment_has_is_refused():
    with pytest.raises(InvalidValueError, match=r"Recipe\.kidnap_every_s is no setting"):
        offline.spec_of(Recipe(**{**vars(RECIPE), "kidnap_every_s": 5.0}))


def test_minari_reads_the_same_values(drive, tmp_path, monkeypatch):
    minari, out = pytest.importorskip("minari"), tmp_path / "rooms"
    generate, words = command(Generate), {"seconds": 30.0, "format": "minari"}
    generate(["arena"], out, seed=1, split="train:1,test:1", **words)
    assert all(finding.ok for finding in check_dataset(out))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(out))
    assert list(minari.list_local_datasets()) == ["arena-d0_5-test-v0", "arena-d0_5-train-v0"]
    there = minari.load_dataset("arena-d0_5-train-v0")
    (episode,) = there.iterate_episodes()
    for k in range(len(drive.rewards) + 1):
        same({name: values[k] for name, values in episode.observations.items()}, drive, k)
    for name in ("actions", "rewards", "terminations", "truncations"):
        np.testing.assert_array_equal(getattr(episode, name), getattr(drive, name))
    for name, values in drive.infos.items():
        np.testing.assert_array_equal(episode.infos[name], values)
    same(there.recover_environment().reset(seed=1)[0], drive, 0)
    before = (out / "SHA256SUMS").read_bytes()
    generate(["arena"], out, seed=1, split="train:1,test:1", **words)  # nothing is missing
    assert (out / "SHA256SUMS").read_bytes() == before
    again = tmp_path / "again"
    generate(["arena"], again, seed=1, split="train:1,test:1", **words)
    assert (again / "SHA256SUMS").read_bytes() == before
    (out / "arena-d0_5-train-v0" / "data" / "metadata.json").write_text(json.dumps({}))
    shutil.rmtree(out / "arena-d0_5-test-v0")  # made again, which lists no damage as sound
    generate(["arena"], out, seed=1, split="train:1,test:1", **words)
    (found,) = check_dataset(out)
    assert found.why.count("damaged") == 1, found
