# SPDX-License-Identifier: Apache-2.0
"""Topics of ROS 2 over Zenoh, as ``rmw_zenoh_cpp`` has them (docs/design.md of ros2/rmw_zenoh).

A topic "/scan" has the key "0/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_…": domain, name, type
and the hash of its definition. Each message brings 33 bytes: number, time, and who sent it. Tokens
of liveliness are what ``ros2 topic list`` shows. Nodes meet at a router; where none listens at its
usual port, we are it.
"""

import itertools
import os
import struct
import time
from collections import deque
from contextlib import suppress
from threading import Condition
from typing import Any

import zenoh
import zenoh.ext
import zenoh.handlers

from slam.errors import InvalidValueError
from slam.ros.link import NODE, Taken, Topic, open_to_others, type_name
from slam.ros.template import STORE

_NO_HASH = "TypeHashNotSupported"  # what rmw_zenoh of Humble has in a hash's place
_OLD = "humble"
_PATIENT_MS = 10_000
_OVERRIDE = "ZENOH_CONFIG_OVERRIDE"
_gids = itertools.count(1)


def open_link(domain: int, namespace: str, router: int) -> "ZenohLink":
    """A session: with a router that is there, or as the router."""
    return ZenohLink(_session(router), domain, namespace)


def _session(router: int) -> Any:
    """As rmw_zenoh finds its way: by a file, by single values, or the usual router."""
    file, values = (os.environ.get(name, "") for name in ("ZENOH_SESSION_CONFIG_URI", _OVERRIDE))
    try:
        if file:
            return zenoh.open(zenoh.Config.from_file(file))
        config = _config("client", "connect", f"tcp/127.0.0.1:{router}")
        if values:
            for path, _, value in (word.partition("=") for word in values.split(";") if word):
                config.insert_json5(path.strip(), value)
            return zenoh.open(config)
        with suppress(zenoh.ZError):
            return zenoh.open(config)
        host = "[::]" if open_to_others() else "127.0.0.1"
        with suppress(zenoh.ZError):
            return zenoh.open(_config("router", "listen", f"tcp/{host}:{router}"))
        config.insert_json5("connect/timeout_ms", str(_PATIENT_MS))  # there is one, and it is busy
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise InvalidValueError(f"Zenoh cannot be opened: {error!s:.200}") from error


def _config(mode: str, side: str, endpoint: str) -> Any:
    config = zenoh.Config()
    config.insert_json5("mode", f'"{mode}"')
    config.insert_json5(f"{side}/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    if mode == "client":
        config.insert_json5("connect/timeout_ms", "500")
    return config


def _qos(topic: Topic) -> str:
    """As a token says it: reliability, durability, history; what is usual is left out."""
    reliability, durability = "" if topic.reliable else "2", "1" if topic.latched else ""
    return f"{reliability}:{durability}:,{topic.depth}:,:,:,,"


class ZenohLink:
    """One session with one node."""

    def __init__(self, session: Any, domain: int, namespace: str) -> None:
        self._session, self._domain, self._namespace = session, domain, namespace
        self._id, self._entities = str(session.info.zid()), itertools.count(1)
        self._tokens = [session.liveliness().declare_token(f"{self._token('NN', 0)}")]
        self._publishers: dict[Topic, tuple[Any, bytes]] = {}
        self._numbers: dict[Topic, int] = {}
        self._own: set[bytes] = set()
        self._subscribers: dict[Topic, Any] = {}
        self._come: dict[Topic, deque[Taken]] = {}
        self._some = Condition()

    def _token(self, kind: str, entity: int) -> str:
        above = self._namespace.replace("/", "%") or "%"
        return f"@ros2_lv/{self._domain}/{self._id}/0/{entity}/{kind}/%/{above}/{NODE}"

    def _key(self, topic: Topic) -> str:
        old = os.environ.get("ROS_DISTRO", "") == _OLD
        found = _NO_HASH if old else STORE.hash_rihs01(topic.kind)
        name = topic.within(self._namespace).lstrip("/")
        return f"{self._domain}/{name}/{type_name(topic.kind)}/{found}"

    def _declare(self, kind: str, topic: Topic) -> None:
        """A token for a publisher ("MP") or a subscription ("MS")."""
        key = self._key(topic).split("/")
        name = topic.within(self._namespace).replace("/", "%")
        words = [self._token(kind, next(self._entities)), name, *key[-2:], _qos(topic)]
        self._tokens.append(self._session.liveliness().declare_token("/".join(words)))

    def _publisher(self, topic: Topic) -> tuple[Any, bytes]:
        if topic not in self._publishers:
            control = zenoh.CongestionControl
            options: dict[str, Any] = {
                "congestion_control": control.BLOCK if topic.waits else control.DROP
            }
            if topic.latched:
                options |= {
                    "cache": zenoh.ext.CacheConfig(topic.depth), "publisher_detection": True
                }  # fmt: skip
                made = zenoh.ext.declare_advanced_publisher(
                    self._session, self._key(topic), **options
                )
            else:
                made = self._session.declare_publisher(self._key(topic), **options)
            sender = struct.pack("<QQ", next(_gids), time.time_ns())
            self._own.add(sender)
            self._publishers[topic] = (made, sender)
            self._declare("MP", topic)
        return self._publishers[topic]

    def advertise(self, topic: Topic) -> None:
        """Show that messages will come."""
        self._publisher(topic)

    def publish(self, topic: Topic, data: bytes) -> None:
        """Send a message."""
        publisher, sender = self._publisher(topic)
        number = self._numbers[topic] = self._numbers.get(topic, 0) + 1
        attachment = struct.pack("<qqB", number, time.time_ns(), len(sender)) + sender
        publisher.put(bytes(data), attachment=attachment)

    def subscribe(self, topic: Topic) -> None:
        """Listen from now on; to what was kept, too, where the topic is latched."""
        if topic in self._subscribers:
            return
        come = self._come[topic] = deque[Taken](maxlen=max(topic.depth, 1))

        def heard(sample: Any) -> None:
            attached = sample.attachment
            sender = b"" if attached is None else attached.to_bytes()[17:]
            if sender in self._own:  # out of our own cache
                return
            with self._some:
                come.append(Taken(sample.payload.to_bytes(), sender.hex()))
                self._some.notify()

        # in the thread that receives: one a topic would lose the order in which they were sent
        handler = zenoh.handlers.Callback(heard, indirect=False)
        remote = zenoh.Locality.REMOTE
        if topic.latched:
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=topic.depth)
            made = zenoh.ext.declare_advanced_subscriber(
                self._session, self._key(topic), handler, history=history, allowed_origin=remote
            )
        else:
            made = self._session.declare_subscriber(
                self._key(topic), handler, allowed_origin=remote
            )
        self._subscribers[topic] = made
        self._declare("MS", topic)

    def take(self, topic: Topic) -> list[Taken]:
        """What has come since it was last asked."""
        self.subscribe(topic)
        come = self._come[topic]
        with self._some:
            found = list(come)
            come.clear()
        return found

    def wait(self, timeout_s: float) -> None:
        """Until something has come, or for so long."""
        with self._some:
            self._some.wait_for(lambda: any(self._come.values()), max(0.0, timeout_s))

    def listeners(self, topic: Topic) -> int:
        """1 where somebody listens."""
        return int(self._publisher(topic)[0].matching_status.matching)

    def close(self) -> None:
        """Leave the network."""
        self._session.close()
