# SPDX-License-Identifier: Apache-2.0
"""Numbers of the benchmark on pages: all are written by one script from the runs that ship."""

import re
from pathlib import Path

import pytest

from scripts.benchmark import days, runs_file
from scripts.benchmark.publish import BOARD, DOCS, FRONT, PAGE, blocks
from scripts.benchmark.tracks import TRACKS
from scripts.marks import filled
from scripts.result_files import RESULTS

pytestmark = pytest.mark.docs
BLOCKS = blocks(runs_file.read(), days.read(RESULTS / days.NAMES[1]))
OWN = [(DOCS / page).resolve() for page in (FRONT, PAGE, BOARD, "index.md")]  # of nothing else
OTHERS = sorted({*DOCS.rglob("*.md")} - {*OWN})
MARKED = re.compile(r"<!-- (\S+) -->.*?<!-- /\1 -->", re.DOTALL)
COUNT = re.compile(r"\b\d+ of \d+\b|\blost in (?:\d+|none|one|two|three|four|five|six)\b")
SHARE = re.compile(r"\b(?!95 %)\d+ %")
TRACK = re.compile("|".join(rf"{t.family}-v\d|`{t.family}`" for t in TRACKS.values()))


@pytest.mark.parametrize(("page", "mark", "told"), BLOCKS, ids=[b[1] for b in BLOCKS])
def test_a_marked_place_has_what_the_runs_that_ship_give(page: str, mark: str, told: str):
    text = (DOCS / page).read_text()
    assert text == filled(text, mark, told, page), "python -m scripts.benchmark.publish"


@pytest.mark.parametrize("page", [*OWN, *OTHERS], ids=lambda page: page.name)
def test_no_number_of_the_benchmark_stands_elsewhere(page: Path):
    for paragraph in MARKED.sub("", page.read_text()).split("\n\n"):
        if page in OWN or TRACK.search(paragraph):
            assert not COUNT.search(paragraph), paragraph
        assert page not in OWN or not SHARE.search(paragraph), paragraph
