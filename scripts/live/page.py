# SPDX-License-Identifier: Apache-2.0
"""What stands beside the scene: how the run goes, what happened, and everything one can ask for.

Callbacks run in threads of viser. They make requests, which are checked at birth, and hand them
over; they touch neither the world nor the playback.
"""

import html
import importlib
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from scripts.live.messages import Controls
from scripts.live.playback import (
    KEPT_S,
    Anew,
    Click,
    Drive,
    Inbox,
    Playback,
    Request,
    Run,
    Seek,
    Speed,
    Step,
    Tour,
)
from scripts.live.session import Session
from sim.view.moment import Shown
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import MobiliaError
from slam.system import names as slams

STATUS_S, PLOT_S = 0.2, 0.5  # of the wall: so often the words and the plot are told anew
MOST_SAID = 4  # lines of events
ANSWER_S = 4.0  # of the wall: so long the title says what was done
BACK_S = 5.0  # that a key looks back
HOLD_HZ = 4.0  # twists a second while a key of the pad is held
SHOVE, CARRY = "shove or open", "carry the robot there"
SPEEDS = ("0.25", "0.5", "1", "2", "5", "10")
CROWDS = ("the scene's own", "none")
# as of ROS 2's teleop_twist_keyboard, where viser knows the key
TWISTS = {
    "forward": ("I", 0.5, 0.0), "forward left": ("U", 0.4, 0.8), "forward right": ("O", 0.4, -0.8),
    "left": ("J", 0.0, 1.0), "stop": ("K", 0.0, 0.0), "right": ("L", 0.0, -1.0),
    "back": ("M", -0.3, 0.0),
}  # fmt: skip
PAD = ("forward", "left", "right", "back")


class Page:
    """The panel of one view; ``show`` is called by one thread.

    gui    of viser, which pages may set by ``controls``;   inbox  where requests go
    """

    def __init__(
        self, gui: Any, scene: Any, controls: Controls, inbox: Inbox, settings: dict[str, Any]
    ) -> None:
        self._gui, self._controls, self._inbox = gui, controls, inbox
        self._said: deque[str] = deque(maxlen=MOST_SAID)
        self._series: deque[tuple[float, ...]] = deque(maxlen=1200)
        self._shown_s = self._plot_s = -math.inf
        self._wall = time.monotonic
        self._answer, self._answer_until, self._labelled = "", 0.0, ""
        self._back_s = 0.0  # of the moment that is shown
        self._status = gui.add_html("starting: inner loops are compiled the first time")
        self._plot = self._plotted()
        self._events = gui.add_html("")
        if settings["room"]:
            self._driving(scene)
        self._time()
        self._world(settings)

    # -- what is told -------------------------------------------------------------------------

    def show(self, shown: Shown, playback: Playback, session: Session) -> None:
        """What the words and the plot say of a moment."""
        now, name = self._wall(), shown.primary
        (off, _), (claimed, _) = shown.error(name), shown.claimed(name)
        self._back_s = playback.present.seconds - shown.seconds if playback.present else 0.0
        if not playback.looks_back:
            self._series.append((shown.seconds, off, claimed))
        for said in shown.said if not playback.looks_back else ():
            self._said.appendleft(said)
            self._events.content = _lines(self._said)
        if now - self._shown_s >= STATUS_S or not playback.playing:
            self._shown_s = now
            self._status.content = self._words(shown, playback, session, off, claimed)
            self._play.label = "Pause" if playback.playing else "Play"
            verdict = f"{shown.seconds:.0f} s · {name}: {shown.verdict}"
            self._label(self._answer if now < self._answer_until else verdict)
        if now - self._plot_s >= PLOT_S and len(self._series) > 1:
            self._plot_s = now
            seconds, offs, claims = np.array(self._series).T
            kept = seconds > shown.seconds - KEPT_S
            self._plot.data = (seconds[kept], 100.0 * offs[kept], 100.0 * claims[kept])

    def say(self, text: str) -> None:
        """A line for the log of events, at once; for a while the panel's title says it too."""
        self._said.appendleft(text)
        self._events.content = _lines(self._said)
        self._answer, self._answer_until = text[:60], self._wall() + ANSWER_S
        self._label(self._answer)

    def _label(self, text: str) -> None:
        """The title of the panel, which is all of it that a phone shows at first."""
        if text != self._labelled:
            self._labelled = text
            self._gui.set_panel_label(text)

    def restart(self) -> None:
        """Another run begins."""
        self._series.clear()

    def _words(
        self, shown: Shown, playback: Playback, session: Session, off: float, claimed: float
    ) -> str:
        hands, name, verdict = session.hands, shown.primary, shown.verdict
        driver = "log" if hands is None else "you drive" if hands.client_drives else "on tour"
        state = "playing" if playback.playing else "paused"
        if playback.looks_back:
            state = "looking back"
        elif playback.ended:
            state = "at its end"
        known = "" if math.isnan(off) else f"{100.0 * off:.1f} cm off, "
        color = "#168c5a" if verdict == "tracking" else "#ce2c3c"
        rows = (
            f"<b>{shown.seconds:.1f} s</b> · {state} · {playback.speed:g} × · {driver}",
            f"{html.escape(name)}: <b style='color:{color}'>{html.escape(verdict)}</b>, "
            f"{known}claims {100.0 * claimed:.1f} cm",
        )
        return f"<div style='margin:0 .6em'>{'<br>'.join(rows)}</div>"

    def _plotted(self) -> Any:
        uplot = importlib.import_module("viser.uplot")
        return self._gui.add_uplot(
            data=(np.zeros(2), np.zeros(2), np.zeros(2)),
            series=(
                uplot.Series(label="s"),
                uplot.Series(label="error, cm", stroke="#ce2c3c", width=2),
                uplot.Series(label="claimed, 2 σ", stroke="#a4a8b0", width=1, dash=(4, 3)),
            ),
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
            axes=(uplot.Axis(size=28), uplot.Axis(size=36)),
            legend=uplot.Legend(show=True),
            height=130,
        )

    # -- what can be asked for ----------------------------------------------------------------

    def _ask(self, make: Callable[[], Request]) -> None:
        """Hand a request over; what is wrong with it is told."""
        try:
            self._inbox.put(make())
        except MobiliaError as error:
            self._inbox.refuse(error)

    def _on(self, handle: Any, make: Callable[[Any], Request]) -> Any:
        """Ask when a page, and not we, sets a control or presses a button."""
        self._controls.add(handle)

        @handle.on_click if hasattr(handle, "on_click") else handle.on_update  # type: ignore[untyped-decorator]
        def _(event: Any) -> None:
            if event.client_id is not None:
                self._ask(lambda: make(event.target))

        return handle

    def _key(self, label: str, key: str, make: Callable[[], Request]) -> None:
        command = self._gui.add_command(label, hotkey=key)
        self._controls.add(command)

        @command.on_trigger  # type: ignore[untyped-decorator]
        def _(_event: Any) -> None:
            self._ask(make)

    def _time(self) -> None:
        gui = self._gui
        with gui.add_folder("Time"):
            self._play = self._on(gui.add_button("Pause"), self._toggled)
            self._on(gui.add_button("One scan"), lambda _: Step())
            back = gui.add_slider("s back", min=0.0, max=KEPT_S, step=0.1, initial_value=0.0)
            self._on(back, lambda handle: Seek(back_s=float(handle.value)))
            self._on(gui.add_button("Back to now"), lambda _: Seek(back_s=0.0))
            speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
            self._on(speed, lambda handle: Speed(factor=float(handle.value)))
        self._key("Play or pause", "P", lambda: self._toggled(None))
        self._key("One scan", "N", Step)
        self._key("Look back", "B", lambda: Seek(back_s=self._back_s + BACK_S))
        self._key("Back to now", "E", lambda: Seek(back_s=0.0))

    def _toggled(self, _handle: Any) -> Request:
        return Run(playing=self._play.label == "Play")

    def _driving(self, scene: Any) -> None:
        gui = self._gui
        with gui.add_folder("Drive and disturb"):
            for name in PAD:
                key, v, omega = TWISTS[name]
                button = gui.add_button(f"{name} ({key})")
                self._holding(button, v, omega)
            self._on(gui.add_button("Back on tour (T)"), lambda _: Tour())
            self._click = gui.add_dropdown("a click", (SHOVE, CARRY), initial_value=SHOVE)
            self._controls.add(self._click)
            self._on(gui.add_button("Push what is nearest (X)"), lambda _: Push())
            self._on(gui.add_button("Open the nearest door"), lambda _: MoveDoor(opened=True))
            self._on(gui.add_button("Close the nearest door"), lambda _: MoveDoor(opened=False))
            self._on(gui.add_button("Carry the robot far away"), lambda _: Kidnap())
        for name, (key, v, omega) in TWISTS.items():
            self._key(name, key, lambda v=v, omega=omega: Drive(v=v, omega=omega))  # type: ignore[misc]
        self._key("Back on tour", "T", Tour)
        self._key("Push what is nearest", "X", Push)

        @scene.on_click()  # type: ignore[untyped-decorator]
        def _(event: Any) -> None:
            carry = self._click.value == CARRY
            ray = tuple(event.ray_origin), tuple(event.ray_direction)
            self._ask(lambda: Click(origin=ray[0], direction=ray[1], carry=carry))

    def _holding(self, button: Any, v: float, omega: float) -> None:
        self._controls.add(button)

        @button.on_hold(callback_hz=HOLD_HZ)  # type: ignore[untyped-decorator]
        def _(_event: Any) -> None:
            self._ask(lambda: Drive(v=v, omega=omega))

    def _world(self, settings: dict[str, Any]) -> None:
        gui = self._gui
        known = list(dict.fromkeys([settings["slam"], *slams()]))
        with gui.add_folder("World", expand_by_default=False):
            slam = gui.add_dropdown("SLAM", known, initial_value=settings["slam"])
            self._controls.add(slam)
            sliders: dict[str, Any] = {}
            if settings["room"]:
                for name in ("motion", "change"):
                    sliders[name] = gui.add_slider(
                        name, min=0.0, max=1.0, step=0.05, initial_value=settings[name]
                    )
                crowds = list(dict.fromkeys([settings["crowd"], *CROWDS]))
                sliders["crowd"] = gui.add_dropdown(
                    "crowd", crowds, initial_value=settings["crowd"]
                )
                for handle in sliders.values():
                    self._controls.add(handle)
            words = "New world, same seed" if settings["room"] else "From the start"

            def anew(_handle: Any) -> Request:
                values = {name: handle.value for name, handle in sliders.items()}
                if values.get("crowd") == CROWDS[0]:
                    del values["crowd"]
                return Anew(slam=slam.value, **values)

            self._on(gui.add_button(words), anew)


def _lines(said: deque[str]) -> str:
    rows = "<br>".join(html.escape(text[:160]) for text in said)
    return f"<div style='margin:0 .6em;font-size:.85em'>{rows}</div>"
