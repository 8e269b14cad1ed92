# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: it draws, keys drive, clicks shove, the past is shown again."""

import io
import math
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scripts.live import served
from scripts.live.replay import Recorder
from scripts.live.session import Opener
from scripts.live.view import View
from sim.view.moment import Moments
from slam.replay import Replay, systems_named
from tests.scripts.report.browser import CHROMIUM, Browser

pytestmark = pytest.mark.film
LOOPBACK = ("127.0.0.1", 0)
OPENER = Opener(slams=["odometry"], settings={"scene": "arena", "dynamism": 0.0}, seconds=600.0)
LIMIT_S = 120.0
SIZE = 800, 500  # px; software GL pays for each


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    pytest.importorskip("viser")
    view = View(OPENER, LOOPBACK)
    over = threading.Event()

    def turn() -> None:
        while not over.is_set():
            view.turn()

    thread = threading.Thread(target=turn)
    thread.start()
    yield view
    over.set()
    thread.join()
    view.close()


@pytest.fixture(scope="module")
def browser(view: View, tmp_path_factory) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with Browser(tmp_path_factory.mktemp("profile"), gl=True) as browser:
        browser.open(f"http://127.0.0.1:{view.served.port}/", *SIZE)
        until(lambda: "odometry" in words(browser))
        yield browser


def until(true: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT_S
    while not true():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.1)


def words(browser: Browser) -> str:
    return str(browser.evaluate("document.body.innerText"))


def picture(browser: Browser) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(browser.pixels())).convert("RGB")).astype(int)


def truth(view: View) -> np.ndarray:
    return view.playback.present.truth_map[:2]


def colors(browser: Browser) -> dict[str, int]:
    """How many pixels of the left of the page, where the scene is, are of which colour."""
    red, green, blue = np.moveaxis(picture(browser)[:, :450], -1, 0)
    return {
        "drawn": int(((red < 235) | (green < 235) | (blue < 235)).sum()),
        "scan": int(((blue > 180) & (red < 120) & (green < 170)).sum()),
        "estimate": int(((red > 190) & (green > 70) & (green < 150) & (blue < 90)).sum()),
    }


def test_the_page_draws_the_room_the_scan_and_the_estimate(browser: Browser):
    until(lambda: colors(browser)["scan"] > 20)
    seen = colors(browser)
    assert seen["drawn"] > 20_000
    assert seen["estimate"] > 20


def test_keys_drive_and_the_tour_goes_on(browser: Browser, view: View):
    start = truth(view)

    def gone() -> bool:
        browser.press("I")
        return math.hypot(*(truth(view) - start)) > 0.2

    until(gone)
    until(lambda: browser.press("I") or "you drive" in words(browser))
    browser.press("T")
    until(lambda: "on tour" in words(browser))


def test_a_click_shoves_the_chair_that_is_seen_there(browser: Browser, view: View):
    world = view.session.hands.simulation.world
    camera = next(iter(view.served._viser.get_clients().values())).camera
    for row, name in enumerate(world.mover_names):
        before = world.mover_poses()[row, :2]
        x, y = projected(camera, (*before, 0.45))
        if name.startswith("chair") and 0 < x < 450 and 0 < y < SIZE[1]:
            break
    browser.click(x, y)
    until(lambda: np.hypot(*(world.mover_poses()[row, :2] - before)) > 0.1)
    until(lambda: f"you: {world.mover_names[row]} is pushed" in words(browser))


def test_a_phone_shows_the_room_upright_and_a_tap_shoves(view: View, tmp_path: Path):
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    size, before = (390, 780), set(view.served._viser.get_clients())
    world = view.session.hands.simulation.world
    with Browser(tmp_path, gl=True) as phone:
        phone.open(f"http://127.0.0.1:{view.served.port}/", *size)
        until(lambda: set(view.served._viser.get_clients()) - before)
        (client,) = set(view.served._viser.get_clients()) - before
        camera = view.served._viser.get_clients()[client].camera
        until(lambda: abs(camera.position[0] - camera.look_at[0]) > 1.0)  # its long side is up
        until(lambda: "Drive" not in words(phone))  # the panel is a strip
        chairs = [k for k, name in enumerate(world.mover_names) if name.startswith("chair")]
        start = world.mover_poses()[chairs, :2]

        def shoved() -> bool:
            for x, y in (projected(camera, (*xy, 0.45)) for xy in start):
                if 20 < x < 370 and 200 < y < 700:  # neither under viser's notice nor the strip
                    break
            for kind, points in (("touchStart", [{"x": x, "y": y}]), ("touchEnd", [])):
                phone.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
            time.sleep(1.0)
            moved = world.mover_poses()[chairs, :2] - start
            return bool((np.hypot(*moved.T) > 0.1).any())

        until(lambda: shoved() and "is pushed" in words(phone))  # said for some seconds


def projected(camera, place) -> tuple[float, float]:
    """CSS pixels of a place in the world, as a camera of viser sees it."""
    w, x, y, z = camera.wxyz
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    local = turn.T @ (np.array(place) - camera.position)
    wide, high = camera.image_width, camera.image_height
    focal = 0.5 * high / math.tan(0.5 * camera.fov)
    return 0.5 * wide + focal * local[0] / local[2], 0.5 * high + focal * local[1] / local[2]


def test_the_past_is_shown_again_and_not_touched(browser: Browser, view: View):
    until(lambda: view.playback.present.seconds > 6.0)
    browser.press("P")
    until(lambda: "paused" in words(browser))
    present = view.playback.present.seconds
    browser.press("B")
    until(lambda: "looking back" in words(browser))
    assert view.playback.shown.seconds == pytest.approx(present - 5.0, abs=0.1)

    def told() -> float:
        return float(re.search(r"([\d.]+) s · looking back", words(browser))[1])

    until(lambda: told() == pytest.approx(view.playback.shown.seconds, abs=0.06))
    browser.press("X")
    until(lambda: "an earlier moment is shown" in words(browser))


def test_nothing_left_the_machine_and_nothing_went_wrong(browser: Browser, view: View):
    own = ("http://127.0.0.1:", "data:", "blob:")
    assert [url for url in browser.requests if not url.startswith(own)] == []
    assert [line for line in browser.console if '"type": "error"' in line] == []


def test_only_loopback_is_private():
    assert all(served.is_loopback(host) for host in ("127.0.0.1", "localhost", "::1", "127.9.9.9"))
    assert not any(served.is_loopback(host) for host in ("0.0.0.0", "192.168.1.2", "a.example", ""))


def written(path: Path) -> Path:
    """A replay of two seconds."""
    session = OPENER.open()
    replay = Replay.of(systems_named(["occupancy"]))
    stage = session.footage.stage
    moments = Moments(replay)
    with Recorder.writing(path, moments, stage.world, title="<arena>", seconds=2.0) as recorder:
        for frame in replay.run(session.footage.stream):
            recorder.note(moments.note(frame, stage.placed))
            if moments.seconds >= 2.0:
                break
    return path


def test_a_replay_plays_from_disk_and_is_the_same_again(tmp_path: Path):
    pytest.importorskip("viser")
    page, again = written(tmp_path / "replay.html"), written(tmp_path / "again.html")
    assert page.read_bytes() == again.read_bytes()
    assert page.stat().st_size < 2_000_000
    assert "<title>&lt;arena&gt;</title>" in page.read_text()
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with Browser(tmp_path / "profile", gl=True) as browser:
        dark = {"name": "prefers-color-scheme", "value": "dark"}
        browser.call("Emulation.setEmulatedMedia", features=[dark])
        browser.open(page, 390, 500)
        until(lambda: "occupancy: tracking, ±" in words(browser))
        assert browser.evaluate("document.documentElement.dataset.mantineColorScheme") == "dark"
        until(lambda: colors(browser)["scan"] > 5)
        own = ("file://", "data:", "blob:")
        assert [url for url in browser.requests if not url.startswith(own)] == []
        assert [line for line in browser.console if '"type": "error"' in line] == []


def test_the_server_behind_the_gate_knows_the_gate_only(view: View):
    connect = pytest.importorskip("websockets.sync.client").connect
    closed = pytest.importorskip("websockets.exceptions").ConnectionClosed
    behind = view.served.behind
    version = [f"viser-v{sys.modules['viser'].__version__}"]
    forged = {"X-Mobilia-Gate": "guess"}
    inner, own = f"ws://{behind[0]}:{behind[1]}", f"ws://127.0.0.1:{view.served.port}"
    for headers in ({}, forged):
        with (
            connect(inner, subprotocols=version, additional_headers=headers) as client,
            pytest.raises(closed),
        ):
            client.recv(timeout=30.0)
    with connect(own, subprotocols=version) as client:
        assert len(client.recv(timeout=30.0)) > 1000
