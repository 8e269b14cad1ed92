# SPDX-License-Identifier: Apache-2.0
"""A Python SLAM as the other end of the pipe: ``python -m slam.guests.serve my_package:MySlam``.

What the SLAM prints goes to standard error: standard output belongs to the protocol.
"""

import argparse
import json
import os
import traceback
from typing import Any, BinaryIO

import numpy as np

from slam.answers import asked, asked_at_end, asked_map, asked_trajectory, judged
from slam.errors import MobiliaError, SlamFailedError
from slam.frames import LaserSpec
from slam.guests import protocol
from slam.interface import RunsAtTheEnd, SlamSystem, told
from slam.names import OURS, SAFE_PATH, look_in
from slam.system import create


class Server:
    """Answers each message with one line; a failure is an answer too."""

    def __init__(self, name: str, options: dict[str, Any]) -> None:
        self._name, self._options = name, options
        self._system: SlamSystem | None = None
        self._laser: LaserSpec | None = None
        self._stamps: list[int] = []

    def answer(self, request: bytes) -> bytes:
        """The line that answers ``request``."""
        try:
            return self._answer(protocol.message_of(request))
        except SlamFailedError as error:
            traceback.print_exc()
            return protocol.line(protocol.error_message(error.message, error.outcome))
        except MobiliaError as error:
            return protocol.line(protocol.error_message(str(error), "raised"))
        except (KeyError, TypeError, ValueError) as error:
            words = f"no message of this protocol: {told(error)}"
            return protocol.line(protocol.error_message(words, "bad"))

    def _answer(self, message: dict[str, Any]) -> bytes:
        kind = message.get("type")
        if kind == "hello":
            protocol.check_hello(message)
            self._system = create(self._name, **self._options)
            promises: dict[str, Any] = {"name": self._name, "map": True, "trajectory": True}
            promises["estimates_at_end"] = isinstance(self._system, RunsAtTheEnd)
            return protocol.line({**protocol.hello_message(), **promises})
        if self._system is None:
            raise SlamFailedError("hello comes first", "bad")
        if kind == "frame":
            return self._frame(self._system, message)
        if kind == "reset":
            with judged(self._system.reset):
                self._system.reset()
            self._laser, self._stamps = None, []
            return protocol.line({"type": "reset"})
        if kind == "map":
            return protocol.map_message(asked_map(self._system))
        if kind == "estimates_at_end" and isinstance(self._system, RunsAtTheEnd):
            answers = asked_at_end(self._system, np.array(self._stamps, dtype=np.int64))
            return protocol.line(protocol.at_end_message(*answers))
        if kind == "trajectory":
            stamps = np.array(self._stamps, dtype=np.int64)
            final = asked_trajectory(self._system, stamps)
            return protocol.line(protocol.trajectory_message(final))
        raise SlamFailedError(f"no message of this protocol is a {kind!r:.40}", "bad")

    def _frame(self, system: SlamSystem, message: dict[str, Any]) -> bytes:
        frame = protocol.frame_of(message, self._laser)
        if frame.scan is not None:
            self._laser = frame.scan.spec
        estimate = asked(system, frame)
        self._stamps.append(frame.stamp_ns)
        return protocol.line(protocol.estimate_message(estimate))


def serve(server: Server, requests: BinaryIO, answers: BinaryIO) -> None:
    """Until "bye" or the end of the input."""
    for request in requests:
        if b'"bye"' in request[:20] and protocol.message_of(request).get("type") == "bye":
            return
        answers.write(server.answer(request))
        answers.flush()


def main(arguments: list[str] | None = None) -> None:
    """Take the process's two ends for the protocol; whatever else prints or reads gets none."""
    parser = argparse.ArgumentParser(prog="python -m slam.guests.serve", description=__doc__)
    parser.add_argument("name", help="module:Class, or the name of a registered SLAM")
    parser.add_argument("--options", default="{}", help="of its constructor, a JSON object")
    chosen = parser.parse_args(arguments)
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    look_in(os.getcwd())  # the name was typed by whoever started this
    if os.environ.get(SAFE_PATH) == OURS:  # what the SLAM starts is none of our business
        del os.environ[SAFE_PATH]
    with requests, answers:
        serve(Server(chosen.name, json.loads(chosen.options)), requests, answers)


if __name__ == "__main__":
    main()
