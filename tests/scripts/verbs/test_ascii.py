# SPDX-License-Identifier: Apache-2.0
"""A terminal or a pipe of ASCII, names of files that no encoding knows: words, no tracebacks."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from sim.simulation import stream
from slam.errors import OutputError
from slam.files import write_text
from slam.logs import write_carmen
from tests.processes import mobilia_each

pytestmark = pytest.mark.slow
LOCALES = [
    {"PYTHONIOENCODING": "ascii"},
    {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
]
ODD = os.fsdecode(b"n\xff\xe9")


ESCAPED = {
    "doctor": (0, "\\u2713"), "config shunting": (0, "matching"), "list": (0, "office"),
    "--help": (0, "Usage"), "config crowds": (0, "escorts"), "scene kinds": (0, "stands"),
    "benchmark --plan": (0, "jobs"), "sensor-card --scanner tim561": (0, "\\u2713"),
    "run odometry --scene arena --seconds 1 --no-film --out out": (0, "index.html"),
    "run nobody\u2713 --scene arena": (2, "no SLAM is called 'nobody"),
}  # fmt: skip
NAMED = {
    f"run odometry --log {ODD}.log --out {ODD}-log": 0,
    f"run odometry --scene arena --seconds 0.5 --no-film --out {ODD}-run": 0,
    f"generate arena --seconds 0.2 --out {ODD}-data": 0,
    f"export {ODD}.log --to tum": 0, f"render {ODD}.log --replay {ODD}.html": 0,
    f"verify {ODD}.log": 1, f"live --log {ODD}.bag": 2, f"score {ODD}.bag": 2,
    f"scene from-log {ODD}.log --slam occupancy": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def answers(tmp_path_factory) -> dict[str, SimpleNamespace]:
    """Of ``ESCAPED`` by a pipe and by a locale in turns, and of ``NAMED``."""
    found, here = {}, tmp_path_factory.mktemp("here")
    write_carmen(here / f"{ODD}.log", stream("arena", seed=3, dynamism=0.0, seconds=3.0))
    for k, locale in enumerate(LOCALES):
        found |= mobilia_each([words for words in ESCAPED if len(words) % 2 == k], here, **locale)
    return found | mobilia_each([*NAMED], here)


@pytest.mark.parametrize("words", ESCAPED)
def test_what_ascii_has_not_is_its_escape(words, answers):
    done, (status, says) = answers[words], ESCAPED[words]
    assert done.returncode == status, done.stderr
    assert says in done.stdout + done.stderr
    assert (done.stdout + done.stderr).isascii()
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("words", NAMED)
def test_a_name_of_no_encoding_is_one(words, answers):
    done = answers[words]
    assert done.returncode == NAMED[words], done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == (NAMED[words] != 0)


def test_a_text_that_no_file_can_hold_is_told(tmp_path: Path):
    with pytest.raises(OutputError, match="a name that is no UTF-8"):
        write_text(tmp_path / "a", f"plan = {ODD}")
    assert not list(tmp_path.iterdir())
