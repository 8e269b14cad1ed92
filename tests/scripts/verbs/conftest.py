# SPDX-License-Identifier: Apache-2.0
"""The command line without a process of its own."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from scripts.cli import main


@pytest.fixture
def called(capsys, monkeypatch) -> Callable[..., SimpleNamespace]:
    """``mobilia`` without the process: what it printed, and its exit status."""

    def call(*words: str | Path) -> SimpleNamespace:
        monkeypatch.setattr(sys, "argv", ["mobilia", *map(str, words)])
        monkeypatch.setattr(sys, "path", [*sys.path])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        return SimpleNamespace(returncode=ended.value.code, stdout=printed.out, stderr=printed.err)

    return call
