# SPDX-License-Identifier: Apache-2.0
"""Every command that README, docs, helps and messages print is one that ``mobilia`` takes."""

import re
from pathlib import Path

import pytest
import typer

from scripts.cli import app
from scripts.spec import command_line, options_of
from slam.errors import InvalidValueError
from tests.commands import KINDS, of_markdown, read_by

REPO = Path(__file__).resolve().parents[1]
PAGES = [REPO / "README.md", REPO / "CONTRIBUTING.md", *sorted((REPO / "docs").rglob("*.md"))]
OURS = ("scripts", "sim", "slam", "scenes")
FILES = [path for package in OURS for path in (REPO / package).rglob("*")]
SOURCES = [path for path in FILES if path.suffix in (".py", ".html", ".toml")]
_REST = r"(?: [^\s`'\"\[\](),;:]+)*)"  # of a command in prose


@pytest.mark.docs
def test_commands_in_blocks_of_code_are_read(monkeypatch: pytest.MonkeyPatch):
    read = read_by(monkeypatch)
    lines = [line for page in PAGES for line in of_markdown(page.read_text())]
    assert len(lines) > 100
    for line in lines:
        read(line)


def test_examples_of_helps_are_read(monkeypatch: pytest.MonkeyPatch):
    read = read_by(monkeypatch)
    for kind in KINDS:
        for line in re.findall(r"\[bold\](mobilia .*?)\[/bold\]", kind.__doc__ or "", re.DOTALL):
            read(line)


def test_options_beside_a_verb_in_prose_and_messages_are_its_own():
    group = typer.main.get_command(app)
    verbs = {**group.commands, **group.commands["scene"].commands}
    texts = [p.read_text() for p in (*PAGES, *SOURCES)]
    said = re.findall(r"\bmobilia (?:--with \S+ )?(?:scene )?([a-z-]+)(" + _REST, "\n".join(texts))
    known = {
        verb: {word for one in verb_of.params for word in (*one.opts, *one.secondary_opts)}
        for verb, verb_of in verbs.items()
    }
    seen = 0
    for verb, rest in said:
        for word in re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", rest.partition("mobilia ")[0]):
            if verb in known:
                assert word in {*known[verb], "--help"}, f"mobilia {verb}{rest}"
                seen += 1
    assert seen > 200


def test_a_command_line_is_made_of_what_the_verb_has(monkeypatch: pytest.MonkeyPatch):
    line = command_line("blame", every=2, folder="a folder", trust=True, slam=None, who=["a", "b"])
    assert line == "mobilia blame 'a folder' --every 2 --trust --who a b"
    asked = read_by(monkeypatch)(line)
    assert (asked.folder, asked.every, asked.trust) == (Path("a folder"), 2, True)
    assert asked.who == ["a", "b"]
    with pytest.raises(KeyError):
        command_line("live", slams=["ekf"])
    with pytest.raises(InvalidValueError, match=r"--port must lie in 0\.\.65535, got 99999999"):
        command_line("live", port=99_999_999)


def test_every_option_is_called_as_it_is_typed():
    for kind in KINDS:
        for one in options_of(kind):
            assert one.word.startswith("--"), one.name
            assert "_" not in one.word
