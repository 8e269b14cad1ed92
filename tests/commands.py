# SPDX-License-Identifier: Apache-2.0
"""Commands that somebody printed, as the real command line reads them."""

import html
import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from scenes import registry
from scripts.cli import VERBS, Everywhere, app
from scripts.options import named
from scripts.spec import SCENES, SLAMS, Option, spec_of
from scripts.verbs.scene import SPECS
from slam import system

KINDS = (Everywhere, *map(spec_of, VERBS), *SPECS.values())
_BLOCK = re.compile(r"^```\w*\n(.*?)^```|((?:^    .*\n)+)", re.DOTALL | re.MULTILINE)
_LINE = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?(mobilia .*)$", re.MULTILINE)
_SHOWN = re.compile(r"<pre[^>]*>(mobilia .*?)</pre>", re.DOTALL)


def of_markdown(text: str) -> list[str]:
    """The command lines in blocks of code."""
    blocks = "\n".join(fenced or indented for fenced, indented in _BLOCK.findall(text))
    return _LINE.findall(re.sub(r"\\\n\s*", " ", blocks))


def of_page(page: Path) -> list[str]:
    """The command lines of a page in HTML."""
    found = map(html.unescape, _SHOWN.findall(page.read_text()))
    return [line for block in found for line in block.splitlines()]


def read_by(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    """Reads a command line up to the verb's spec, which is not called; fails for a wrong one."""
    found: list[Any] = []
    for kind in KINDS:
        monkeypatch.setattr(kind, "__call__", lambda self: found.append(self))

    def read(line: str) -> Any:
        found.clear()
        done = CliRunner().invoke(app, shlex.split(line, comments=True)[1:])
        assert done.exit_code == 0, f"{line}: {done.exception!r} {done.output}"
        for one, value in _given(found[-1]):
            for name in value if isinstance(value, list) else [value]:
                if one.complete is SLAMS and one.name != "oracle" and isinstance(name, str):
                    for each in named([name]):
                        system.check_name(each)
                elif one.complete is SCENES and isinstance(name, str) and "." not in name:
                    registry.check_name(name)
        return found[-1]

    return read


def _given(spec: Any) -> Iterator[tuple[Option, Any]]:
    for one in fields(spec):
        about, value = one.metadata["is"], getattr(spec, one.name)
        if isinstance(about, Option):
            yield replace(about, name=one.name), value
        else:
            yield from _given(value)
