# SPDX-License-Identifier: Apache-2.0
"""What stands beside the scene: how the run goes, what happened, and everything one can ask for.

Callbacks run in threads of viser. They make requests, which are checked at birth, and hand them
over; they touch neither the world nor the playback.
"""

import html
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from scripts.live.drawn import legend, told
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
from sim.view import draw
from sim.view.moment import Shown, verdict_of
from sim.world.requests import Kidnap, MoveDoor, Push
from slam.errors import MobiliaError
from slam.system import names as slams

STATUS_S, PLOT_S = 0.2, 0.5  # of the wall: so often the words and the plot are told anew
MOST_SAID = 4  # lines of events, and of what was asked for
MARKS_M, MOST_M = (1e-3, 1e-2, 1e-1, 1.0, 10.0), 30.0  # of the plot's axis, a logarithmic one
ANSWER_S = 4.0  # of the wall: so long the title says what was done
BACK_S = 5.0  # that a key looks back
HOLD_HZ = 4.0  # twists a second while a key of the pad is held
SHOVE, CARRY = "push or open", "carry the robot there"
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
        self._own: deque[str] = deque(maxlen=MOST_SAID)
        self._happened: deque[str] = deque(maxlen=MOST_SAID)
        self._series: deque[tuple[float, ...]] = deque(maxlen=2400)
        self._shown_s = self._plot_s = -math.inf
        self._number = -1  # of the last moment that was noted
        self._answer, self._answer_until = "", 0.0
        self._at_s = self._back_s = 0.0  # of the moment that is shown
        self._status = gui.add_html("starting: inner loops are compiled the first time")
        self._answers = gui.add_html("")
        self._plot = self._plotted()
        self._events = gui.add_html("")
        self._legend = gui.add_html("")
        if settings["room"]:
            self._driving(scene)
        self._time()
        self._world(settings)

    # -- what is told -------------------------------------------------------------------------

    def show(self, shown: Shown, playback: Playback, session: Session) -> None:
        """What the words and the plot say of a moment."""
        now, name, self._at_s = time.monotonic(), shown.primary, shown.seconds
        self._back_s = playback.present.seconds - shown.seconds if playback.present else 0.0
        if shown.number > self._number:
            self._number = shown.number
            both_m = shown.error(name)[0], shown.claimed(name)[0]
            self._series.append((shown.seconds, *np.maximum(both_m, MARKS_M[0])))
            self._happened.extendleft(map(html.escape, shown.said))
        if now - self._shown_s >= STATUS_S or not playback.playing:
            self._shown_s = now
            self._status.content = _words(self._run(shown, playback, session), told(shown))
            self._events.content = _words(*self._happened, kind="log")
            self._legend.content = _words(legend(session.moments))
            self._play.label = "Pause" if playback.playing else "Play"
            (claim, _), *off = shown.told()
            verdict = f"{verdict_of(shown.own)}: {off[0][0]}" if off else claim
            title = f"{shown.seconds:.0f} s · {verdict}"
            # all that a phone shows at first
            self._gui.set_panel_label(self._answer if now < self._answer_until else title)
        if now - self._plot_s >= PLOT_S and len(self._series) > 1:
            self._plot_s = now
            rows = np.array(self._series)
            self._plot.data = tuple(rows[rows[:, 0] > shown.seconds - KEPT_S].T.copy())

    def say(self, text: str, *, own: bool = False) -> None:
        """An event, or what one did oneself; for a while the panel's title says it too."""
        lines, place = (self._own, self._answers) if own else (self._happened, self._events)
        lines.appendleft(html.escape(f"{self._at_s:.1f} s: {text[:160]}"))
        place.content = _words(*lines, kind="log")
        self._answer, self._answer_until = text[:60], time.monotonic() + ANSWER_S
        self._gui.set_panel_label(self._answer)

    def restart(self) -> None:
        """Another run begins."""
        self._series.clear()
        self._number = -1

    def _run(self, shown: Shown, playback: Playback, session: Session) -> str:
        driver = "log"
        if session.hands is not None:
            driver = "you drive" if session.hands.client_drives else "on tour"
        state = "playing" if playback.playing else "paused"
        if playback.looks_back:
            state = "looking back"
        elif playback.ended:
            state = "at its end"
        return f"<b>{shown.seconds:.1f} s</b> · {state} · {playback.speed:g} × · {driver}"

    def _plotted(self) -> Any:
        """Of the last minute, on a logarithmic axis as in films."""
        error = {"label": "error", "stroke": f"rgb{draw.RED}", "width": 2}
        claim = {"label": "2 σ claimed", "stroke": f"rgb{draw.MUTED}", "dash": (4, 3)}
        words = [*map(draw.length, MARKS_M)]
        return self._gui.add_uplot(
            data=(np.arange(2.0), np.full(2, math.nan), np.full(2, math.nan)),
            series=({}, error, claim),
            scales={"x": {"time": False}, "y": {"distr": 3, "range": (MARKS_M[0], MOST_M)}},
            axes=({"size": 34}, {"size": 58, "splits": MARKS_M, "values": words}),
            legend={"live": False}, padding=(12, 16, 0, 0), height=150,
        )  # fmt: skip

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


def _words(*lines: str, kind: str = "") -> str:
    return f"<div class='words {kind}'>{'<br>'.join(lines)}</div>"
