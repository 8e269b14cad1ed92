# SPDX-License-Identifier: Apache-2.0
"""The picture of ``docs/live.md``: ``python -m tests.scripts.live.picture FILE.png``."""

import io
import sys
import tempfile
from pathlib import Path

from PIL import Image

from scripts.live.playback import Run, Speed
from scripts.live.session import Opener
from scripts.live.view import View
from sim.world.requests import Push
from tests.scripts.report.browser import Browser

SETTINGS = {"scene": "office", "dynamism": 0.5, "seed": 0}
PUSH_S, END_S = 20.0, 26.0
CLOSE = "document.querySelectorAll('[class*=Notification-close]').forEach(one => one.click())"


def taken() -> Image.Image:
    """The page after ``END_S``, a chair pushed on the way."""
    view = View(Opener(slams=["shunting"], settings=SETTINGS, seconds=60.0), ("127.0.0.1", 0))
    view._at(Speed(factor=20.0))
    for until_s, request in ((PUSH_S, Push()), (END_S, None)):
        while view.playback.present is None or view.playback.present.seconds < until_s:
            view.turn()
        if request is not None:
            view._touch(request)
    view._at(Speed(factor=1.0))
    view._at(Run(playing=False))
    with tempfile.TemporaryDirectory() as profile, Browser(Path(profile), gl=True) as browser:
        browser.open(f"http://127.0.0.1:{view.served.port}/", 1280, 800)
        for k in range(600):  # a renderer without a graphics card takes some seconds
            view.turn()
            if k == 500:
                browser.evaluate(CLOSE)  # viser says that there is none
        picture = Image.open(io.BytesIO(browser.pixels())).convert("RGB")
    view.close()
    return picture


if __name__ == "__main__":
    taken().quantize(128).save(sys.argv[1], optimize=True)  # few colours: a small file
