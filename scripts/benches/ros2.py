# SPDX-License-Identifier: Apache-2.0
"""What ROS 2 costs a live view: ``python -m scripts.benches.ros2 [dds|zenoh [seconds]]``.

The office with shunting runs at 1 x real time; a process beside it takes each scan off the network
and notes when. Latency is from the moment at which a scan is due to its reception, by one clock.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from scripts.live.session import Opener
from scripts.live.view import Network, View
from sim.view.moment import Shown
from slam.frames import NS_PER_S
from slam.logs.bag import stamp_of
from slam.ros.link import Link, open_link
from slam.ros.node import decoded
from slam.ros.robot import topics
from slam.ros.slam import Domain
from slam.ros.template import said_ns

WARM_S = 5.0  # of compilers, left out
SCAN = replace(topics()["/scan"], depth=1000)


class _Timed(Network):
    """A network that notes when it sends."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.sent_ns: dict[int, int] = {}

    def send(self, shown: Shown) -> None:
        self.sent_ns[said_ns(shown.frame.stamp_ns)] = time.time_ns()
        super().send(shown)


def listen(middleware: str, domain: int, router: int) -> None:
    """Print when each scan came, as JSON, after 3 s without any."""
    link = open_link(middleware, domain=domain, router=router)
    link.subscribe(SCAN)
    came: dict[int, int] = {}
    last_s = time.monotonic() + 60.0
    while time.monotonic() < last_s:
        link.wait(0.5)
        for taken in link.take(SCAN):
            now_ns = time.time_ns()
            came[stamp_of(decoded(SCAN.kind, taken.data), 0)] = now_ns
            last_s = time.monotonic() + 3.0
    link.close()
    print(json.dumps(sorted(came.items())))


def measure(middleware: str, seconds: float) -> None:
    """Run, and print the figures."""
    domain = Domain(middleware, own=True, wait_s=10.0)
    link = open_link(middleware, domain=domain.number, router=domain.router)
    network = _Timed(link)
    words = [sys.executable, "-m", __spec__.name if __spec__ else "", middleware, "listen"]
    child = subprocess.Popen(
        [*words, str(domain.number), str(domain.router)], stdout=subprocess.PIPE, text=True
    )
    opener = Opener(slams=["shunting"], settings={"scene": "office"}, seconds=WARM_S + seconds + 60)
    view = View(opener, ("127.0.0.1", 0), network=network)
    while not link.listeners(topics()["/scan"]):
        time.sleep(0.1)
    while view.playback.present is None or view.playback.present.seconds < WARM_S:
        view.turn()
    first_ns = view.playback.present.frame.stamp_ns
    began_s, spent_s = time.time(), time.process_time()
    while time.time() - began_s < seconds:
        view.turn()
    lived_s, spent_s = time.time() - began_s, time.process_time() - spent_s
    simulated_s = (view.playback.present.frame.stamp_ns - first_ns) / NS_PER_S
    view.close()
    domain.free()
    came = dict(json.loads(child.communicate(timeout=30.0)[0]))
    sent = {stamp: at for stamp, at in network.sent_ns.items() if stamp > said_ns(first_ns)}
    late_ms = [(came[stamp] - at) / 1e6 for stamp, at in sent.items() if stamp in came]
    p50, p99 = np.percentile(late_ms, [50.0, 99.0])
    print(f"{middleware}: {len(late_ms)} of {len(sent)} scans received")
    print(f"latency p50 {p50:.2f} ms, p99 {p99:.2f} ms")
    print(f"{simulated_s / lived_s:.2f} x real time, {spent_s / simulated_s:.2f} cores at 1 x")


if __name__ == "__main__":
    if "listen" in sys.argv:
        listen(sys.argv[1], int(sys.argv[3]), int(sys.argv[4]))
    else:
        parser = argparse.ArgumentParser(description=__doc__)
        parser.add_argument("middleware", nargs="?", choices=("dds", "zenoh"), default="dds")
        parser.add_argument("seconds", nargs="?", type=float, default=30.0)
        asked = parser.parse_args()
        measure(asked.middleware, asked.seconds)
