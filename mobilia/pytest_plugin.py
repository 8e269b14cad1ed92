# SPDX-License-Identifier: Apache-2.0
"""The plugin for pytest: ``mobilia_stream``, a recording of a track for each seed.

    @pytest.mark.mobilia(track="busy-chairs", level=0.5, seeds=3)
    def test_it_holds(mobilia_stream):
        run = mobilia_stream.run(MySlam())
        assert not run.lost and run.error_m < 0.1

pytest loads it wherever mobilia is installed, so it imports nothing until a test asks for it, and
names of newer versions of pytest stand in quotes.
"""

from typing import TYPE_CHECKING

import pytest

import mobilia

if TYPE_CHECKING:
    from scripts.gate.stream import Recorded

MARK = (
    "mobilia(track, level=0.5, seeds=1, seconds=20): run this test on a recording of a track for "
    "each of the first seeds; the fixture mobilia_stream has it"
)
FIXTURE = "mobilia_stream"


def pytest_configure(config: "pytest.Config") -> None:
    """Declare the mark."""
    config.addinivalue_line("markers", MARK)


def pytest_generate_tests(metafunc: "pytest.Metafunc") -> None:
    """A test for each seed; a wrong mark, or a folder that hides a package, is one line."""
    if FIXTURE not in metafunc.fixturenames:
        return
    if hiding := mobilia.hidden():
        pytest.fail(hiding, pytrace=False)
    mark = metafunc.definition.get_closest_marker("mobilia")
    from scripts.gate.stream import asked
    from slam.errors import MobiliaError

    runs, wrong = [], ""
    try:
        runs = asked(mark.args, mark.kwargs) if mark else asked((), {})
    except MobiliaError as error:
        wrong = f"{metafunc.definition.nodeid}: {error}"
    if wrong:  # not while the error is handled, which pytest would print too
        pytest.fail(wrong, pytrace=False)
    ids = [f"{run.track}-{run.at[0]:g}-{run.at[1]}" for run in runs]
    metafunc.parametrize(FIXTURE, runs, indirect=True, ids=ids)


@pytest.fixture
def mobilia_stream(
    request: "pytest.FixtureRequest", tmp_path_factory: "pytest.TempPathFactory"
) -> "Recorded":
    """Frames as a SLAM may see them, and ``run(slam)``; made once and kept in pytest's cache."""
    from scripts.gate.stream import Recorded

    kept = getattr(request.config, "cache", None)  # None: pytest is to keep nothing
    if kept is not None and hasattr(kept, "mkdir"):  # since pytest 7
        return Recorded(request.param, kept.mkdir("mobilia"))
    return Recorded(request.param, tmp_path_factory.mktemp("mobilia"))
