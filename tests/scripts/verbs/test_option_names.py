# SPDX-License-Identifier: Apache-2.0
"""What cannot be is said by the name of the option that was typed."""

import re

import pytest
from typer._completion_classes import BashComplete
from typer.main import get_command

from scripts.cli import app
from scripts.option_names import by_option, flowing

pytestmark = pytest.mark.slow


def test_other_words_stay_as_they_are():
    options = ("--seconds", "--dynamism")
    for said in (
        "Recipe.odometry must be one of a, b",  # the verb has no such option
        "MatcherConfig.seconds must be > 0",  # no field that an option fills
        "x.log: no recipe: seconds must be > 0",
        "--seconds must be > 0",
    ):
        assert by_option(said, options, {}) == said
    said = by_option("Recipe.seconds and Dynamism.motion must be > 0, got 1", options, {})
    assert said == "--seconds and Dynamism.motion must be > 0, got 1"


def test_a_paragraph_of_help_is_one_line():
    assert flowing("First.\n\nOne that\nis long.\n") == "First.\n\nOne that is long."
    for command in get_command(app).commands.values():
        assert not re.search(r"[^\n]\n[^\n]", command.help or ""), command.name


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("run sh", {"shunting", "shunting-features"}),
        ("run shunting,ek", {"shunting,ekf"}),
        ("run shunting --scene off", {"office"}),
        ("compare --slam shunting oc", {"occupancy"}),
        ("benchmark --tracks rush", {"rush-hour-v1"}),
        ("live --scanner utm", {"utm30lx"}),
        ("reproduce vic", {"victoria-park"}),
    ],
)
def test_a_shell_completes_names(words: str, found: set[str]):
    shell = BashComplete(get_command(app), {}, "mobilia", "_MOBILIA_COMPLETE")
    *before, begun = words.split()
    assert {item.value for item in shell.get_completions(before, begun)} == found
