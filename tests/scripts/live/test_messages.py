# SPDX-License-Identifier: Apache-2.0
"""What a page sends is data: only what it was offered is taken, all else changes nothing."""

import logging
import math
import random
from contextlib import closing
from types import SimpleNamespace

import pytest
import viser
from msgspec import msgpack
from websockets.sync.client import connect

from scripts.live.messages import SILENCE_S, Controls, Seldom
from scripts.live.playback import Anew
from scripts.live.session import Opener
from scripts.live.view import View
from slam.errors import UntrustedNameError

OPENER = Opener(slams=["odometry"], settings={"scene": "arena", "dynamism": 0.0}, seconds=600.0)
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0, 0, 9],
    "fov": 1.2, "near": 0.01, "far": 1000.0, "image_height": 480, "image_width": 640,
    "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
CLICK = {
    "type": "ScenePointerMessage", "event_type": "click", "ray_origin": [0.0, 0.0, 9.0],
    "ray_direction": [0.0, 0.0, -1.0], "screen_pos": [[0.5, 0.5]], "modifier": None,
}  # fmt: skip


def handle(name, **said):
    return SimpleNamespace(_impl=SimpleNamespace(uuid=name), **said)


@pytest.fixture
def controls():
    found = Controls()
    found.add(handle("button"))
    found.add(handle("choice", options=("shunting", "ekf")))
    found.add(handle("slider", min=0.0, max=1.0))
    return found


def update(uuid, value):
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


GOOD = [
    CAMERA, CLICK, update("button", True), update("choice", "ekf"), update("slider", 1),
    {"type": "GuiButtonHoldMessage", "uuid": "button", "frequency": 4.0},
    {"type": "CommandTriggerMessage", "uuid": "button"},
]  # fmt: skip
BAD = [
    update("choice", "evil_mod:X"), update("choice", "pipe:sh"), update("choice", 1),
    update("slider", 1.1), update("slider", math.nan), update("slider", "0.5"),
    update("slider", True), update("button", "x"), update("button", 1.5), update("other", True),
    update("choice", "x" * 999), update("slider", [1] * 99), update("slider", {}),
    {"type": "GuiUpdateMessage", "uuid": "slider", "updates": {"value": 0.5, "max": 9.0}},
    {"type": "GuiUpdateMessage", "uuid": "slider", "updates": {"update_cb": []}},
    {"type": "GuiUpdateMessage", "uuid": "slider", "updates": 3},
    {"type": "GuiUpdateMessage", "uuid": ["slider"], "updates": {"value": 0.5}},
    {"type": "CommandTriggerMessage", "uuid": "other"},
    {"type": "ShareUrlRequest"},  # would open a tunnel to somebody's server
    {"type": "FileTransferStartUpload", "size_bytes": 1 << 40},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {**CAMERA, "image_height": 0}, {**CAMERA, "position": [0, 0]}, {**CAMERA, "fov": math.pi},
    {**CLICK, "ray_origin": None}, {**CLICK, "event_type": "rect-select"}, {**CLICK, "more": 1},
    {k: v for k, v in CLICK.items() if k != "screen_pos"},
    {"type": ["x"]}, {}, [], None,
]  # fmt: skip


@pytest.mark.parametrize("words", GOOD)
def test_what_was_offered_is_taken(controls, words):
    assert controls.admits(msgpack.encode(words))
    assert controls.left_out.count == 0


@pytest.mark.parametrize("words", BAD)
def test_anything_else_is_left_out_and_counted(controls, words):
    assert not controls.admits(msgpack.encode(words))
    assert controls.left_out.count == 1


ODD = (math.nan, math.inf, -math.inf, 1e30, None, "x", "pipe:sh", [], {}, -1, 2**63, b"x", [[[1]]])


def test_a_thousand_mutated_messages_raise_nothing_and_pass_no_odd_value(controls):
    rng = random.Random(0)
    for _ in range(1000):
        words = dict(rng.choice(GOOD))
        words[rng.choice([*words, "more"])] = rng.choice(ODD)
        if rng.random() < 0.3 and "updates" in words:
            words["updates"] = {"value": rng.choice(ODD)}
        data = bytearray(msgpack.encode(words))
        if rng.random() < 0.3:  # bytes flipped and cut
            data[rng.randrange(len(data))] ^= 0xFF
            del data[rng.randrange(1, 99) :]
        if controls.admits(bytes(data)):
            words = msgpack.decode(data)
            assert words["type"] in {each["type"] for each in GOOD}
            if "updates" in words:
                value = words["updates"]["value"]
                assert value in (True, False, "shunting", "ekf") or 0.0 <= value <= 1.0


def test_what_was_left_out_is_told_once_a_minute(caplog):
    now = [100.0]
    seldom = Seldom("rubbish", lambda: now[0])
    with caplog.at_level(logging.WARNING):
        for now[0] in (100.0, 101.0, 100.0 + 0.99 * SILENCE_S, 100.0 + SILENCE_S):
            seldom.note()
    told = [record.getMessage() for record in caplog.records]
    assert told == [f"live view: rubbish, {n} so far" for n in (1, 4)]


def test_a_name_of_a_page_is_no_code_unless_the_user_typed_it():
    opener = Opener(slams=["my_package:MySlam"], settings={"scene": "arena"}, seconds=9.0)
    again = opener.anew(Anew(slam="occupancy")).anew(Anew(slam="my_package:MySlam"))
    assert again.slams == ["my_package:MySlam"]
    for name in ("evil_mod:X", "pipe:touch pwned", "ros2:touch pwned"):
        with pytest.raises(UntrustedNameError, match="a page names code"):
            opener.anew(Anew(slam=name)).open()


def test_a_client_that_sets_what_is_not_offered_changes_nothing(tmp_path, monkeypatch, capfd):
    """The page of the attack: a value that no dropdown offers, then the button that uses it."""
    monkeypatch.chdir(tmp_path)
    view = View(OPENER, ("127.0.0.1", 0), playing=False)
    handles = list(view.served.gui._gui_input_handle_from_uuid.values())
    choices = [h for h in handles if hasattr(h, "options")]
    sets = [*choices, *(h for h in handles if hasattr(h, "min"))]
    before, first = [h.value for h in sets], view.session
    anew = next(h for h in handles if getattr(h._impl.props, "label", "") == "New world, same seed")
    with closing(view), connect(
        f"ws://127.0.0.1:{view.served.port}", subprotocols=[f"viser-v{viser.__version__}"],
        compression=None, proxy=None, max_size=None,
    ) as client:  # fmt: skip
        client.send(msgpack.encode(CAMERA))  # from now on it counts as there
        for choice in choices:
            for value in ("evil_mod:X", "pipe:touch pwned", "ros2:touch pwned", "escorts:9"):
                client.send(msgpack.encode(update(choice._impl.uuid, value)))
        for words in [*BAD, update(anew._impl.uuid, True)]:
            client.send(msgpack.encode(words))
        for _ in range(1200):
            view.turn()
            if view.session is not first:
                break
        assert view.session is not first  # the button works, by what was set before
        assert view.session.moments.primary == "odometry"
        assert [h.value for h in sets] == before
        assert view.served.controls.left_out.count == 4 * len(choices) + len(BAD)
    assert not list(tmp_path.iterdir())
    assert "Traceback" not in "".join(capfd.readouterr())
