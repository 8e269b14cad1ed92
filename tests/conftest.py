# SPDX-License-Identifier: Apache-2.0
"""Which tests have a mark of ``pyproject.toml``: one table, by folder, file or test.

``make test-fast`` leaves out all that have one: ``pytest -m "not (slow or docs or ...)"``.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
MARKS: dict[str, tuple[str, ...]] = {
    "golden": ("golden/",),
    # pages, pictures and results of docs/: red when a page lags behind the code
    "docs": (
        "scripts/paper/test_quote.py",
        "scripts/test_marks.py",
        "test_bring_your_own.py",
        "test_extending.py",
        "test_readme.py",
        "test_site.py",
        "test_wheel.py",
    ),
    "film": (
        "scripts/film/",
        "scripts/live/test_view.py",
        "scripts/report/",
        "sim/gym/test_env.py::test_the_cameras_see_a_room",
        "sim/view/",
    ),
    # random calls, random damage, hostile files
    "fuzz": (
        "hostile/",
        "scripts/robustness/",
        "slam/logs/test_bad_numbers.py",
        "slam/logs/test_carmen_damage.py",
    ),
    # whole commands, campaigns, other processes, statistics over many runs
    "slow": (
        "scenes/test_each_scene.py",
        "scenes/test_registry.py",
        "scripts/benchmark/test_days.py",
        "scripts/benchmark/test_outside.py",
        "scripts/comparison/test_again.py",
        "scripts/comparison/test_compare.py",
        "scripts/comparison/test_oracle.py",
        "scripts/comparison/test_outside.py",
        "scripts/days/",
        "scripts/debugger/",
        "scripts/experiments/",
        "scripts/integrity/test_campaign.py",
        "scripts/log_twin/",
        "scripts/paper/test_reproduce.py",
        "scripts/paper/test_runs.py",
        "scripts/test_cold_start.py",
        "scripts/test_options.py::test_a_comparison_over_one_axis",
        "scripts/test_workers.py",
        "scripts/verbs/",
        "sim/actors/test_people.py",
        "sim/actors/test_rearranging.py",
        "sim/actors/test_roles.py",
        "sim/actors/test_sliding_doors.py",
        "sim/gym/",
        "sim/loop/",
        "sim/recording/",
        "sim/sensors/test_odometry.py",
        "sim/test_events.py",
        "sim/test_simulation.py",
        "sim/test_streams.py",
        "sim/twins/",
        "sim/world/test_sessions.py",
        "sim/world/test_world.py",
        "slam/days/test_search.py",
        "slam/days/test_session.py",
        "slam/ekf/test_slam.py",
        "slam/evaluation/scanner/",
        "slam/guests/test_guard.py",
        "slam/guests/test_guests.py",
        "slam/guests/test_pipe.py",
        "slam/landmarks/test_arithmetic.py::test_a_thousand",
        "slam/logs/test_shunting_on_real_logs.py",
        "slam/logs/test_victoria_park.py::test_the_real_park",
        "slam/ros/test_other_makes.py",
        "slam/shunting/test_features.py",
        "slam/shunting/test_foreign_streams.py",
        "slam/shunting/test_reference.py",
        "slam/shunting/test_slam.py::test_a_known_motion",
        "slam/test_jit.py",
        "slam/tracker/belief/test_promises.py",
        "slam/tracker/tracking/test_loops.py",
        "slam/tracker/tracking/test_merging.py::test_round_and_round",
    ),
}


@pytest.fixture(scope="session", autouse=True)
def caches(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests, and the commands that they start, leave no rates or fonts in the user's cache."""
    kept = getattr(pytestconfig, "cache", None)  # None: pytest is to keep nothing
    folder = kept.mkdir("user") if kept else tmp_path_factory.mktemp("user")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield


def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    for item in items:
        where = item.path.relative_to(TESTS).as_posix() + item.nodeid[item.nodeid.find("::") :]
        for mark, places in MARKS.items():
            if where.startswith(places):
                item.add_marker(mark)
