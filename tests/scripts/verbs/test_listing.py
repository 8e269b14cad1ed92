# SPDX-License-Identifier: Apache-2.0
"""``mobilia list`` is whole and plain, in a file as on a terminal."""

import io

import pytest
from rich.console import Console

from scenes import registry
from scripts.verbs import listing
from slam import system

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("terminal", [True, False])
def test_nothing_is_cut_and_nothing_is_marked_up(monkeypatch, terminal: bool):
    file = io.StringIO()
    console = Console(file=file, width=80, force_terminal=terminal, color_system=None)
    monkeypatch.setattr(listing, "console", console)
    listing.Listing()()
    printed = file.getvalue()
    assert "`" not in printed
    assert "…" not in printed
    words = printed.split()
    for name, about in (
        *((name, registry.describe(name)) for name in registry.names()),
        *((name, system.describe(name)) for name in system.names()),
    ):
        assert name in words
        assert " ".join(about.replace("``", "").split()) in " ".join(words)
    if not terminal:  # grep finds all of an entry
        line = next(line for line in printed.splitlines() if line.split()[:1] == ["apartment"])
        assert "n_people (2) people" in line
