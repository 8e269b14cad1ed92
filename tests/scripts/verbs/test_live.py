# SPDX-License-Identifier: Apache-2.0
"""``mobilia live``: what it refuses before anything is built, and when it warns."""

import sys
from types import SimpleNamespace

import pytest

from scripts.live import view
from scripts.live.session import Opener
from scripts.verbs.live import Live
from slam.errors import InvalidValueError

pytestmark = pytest.mark.slow


def test_without_viser_it_says_what_to_install(called, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    ended = called("live", "arena")
    assert ended.returncode == 1
    assert "pip install viser" in ended.stderr


@pytest.mark.parametrize(("host", "warned"), [("127.0.0.1", False), ("0.0.0.0", True)])
def test_an_address_that_others_reach_is_warned_of(host, warned, monkeypatch, capsys):
    closed = []

    class Once:
        served = SimpleNamespace(port=8765, token="a-token" if warned else "")

        def __init__(self, *_: object, **__: object) -> None:
            pass

        def turn(self) -> None:
            raise InvalidValueError("enough")

        def close(self) -> None:
            closed.append(True)

    monkeypatch.setattr(view, "View", Once)
    with pytest.raises(InvalidValueError, match="enough"):
        Live(host=host).serve(Opener(slams=["odometry"]), [])
    printed = " ".join(capsys.readouterr().out.split())
    assert f"http://{host}:8765/" in printed
    assert ("There is no encryption" in printed) is warned
    assert ("/a-token" in printed) is warned
    assert closed == [True]
