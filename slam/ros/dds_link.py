# SPDX-License-Identifier: Apache-2.0
"""Topics of ROS 2 over DDS, by Cyclone DDS: what its rmw and that of Fast DDS speak.

A topic "/scan" is "rt/scan" there, its type "sensor_msgs::msg::dds_::LaserScan_". Types are made of
the definitions that ``slam.ros.template`` serialises by; the bytes go through as they are. Names of
fields are ROS's own: Cyclone DDS matches no reader that names one otherwise.
"""

import os
import socket
import struct
from contextlib import suppress
from functools import cache, partial
from threading import Thread
from typing import Any
from weakref import WeakValueDictionary, finalize

import cyclonedds.idl.types as of
from cyclonedds._clayer import ddspy_take, ddspy_write
from cyclonedds.core import (
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic as DdsTopic
from rosbags.interfaces import Nodetype

from slam.ros.link import Taken, Topic, open_to_others, type_name
from slam.ros.template import STORE

_BASES: dict[str, Any] = {
    "bool": bool, "byte": of.uint8, "char": of.uint8, "octet": of.uint8, "string": str,
    **{name: getattr(of, name) for name in (
        "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32",
        "float64",
    )},
}  # fmt: skip
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
_UNREAD = SampleState.NotRead | ViewState.Any | InstanceState.Any
_MOST = 1000  # messages taken at once
# Of this machine only: what we send has the loopback's address, which nothing routes further.
_ALONE = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    "</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><SPDPInterval>0.25s"
    "</SPDPInterval><Peers><Peer address='127.0.0.1'/>"  # each port in turn, as for LOCALHOST
    "<Peer address='127.0.0.1:{}' PruneDelay='inf'/></Peers></Discovery></Domain></CycloneDDS>"
)
_GROUP = "239.255.0.1"  # where participants with default settings listen for others
_domains: WeakValueDictionary[int, Domain] = WeakValueDictionary()  # those of ``_ALONE``


def open_link(number: int, namespace: str, _router: int) -> "DdsLink":
    """A participant; other machines are seen where ``open_to_others`` or CYCLONEDDS_URI says so."""
    domain = _domains.get(number)
    if domain is None and "CYCLONEDDS_URI" not in os.environ and not open_to_others():
        inbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        inbox.bind(("127.0.0.1", 0))
        domain = _domains[number] = Domain(number, _ALONE.format(inbox.getsockname()[1]))
        end = os.urandom(16)  # which no other process can say
        Thread(target=_repeat, args=(inbox, 7400 + 250 * number, end), daemon=True).start()
        finalize(domain, inbox.sendto, end, inbox.getsockname())
    return DdsLink(number, namespace, domain)


def _repeat(inbox: socket.socket, port: int, end: bytes) -> None:
    """Send what comes to all who listen to others at ``port`` on this machine, until ``end`` comes.

    It goes by every interface, with as many hops to live as keep it here: none.
    """
    with inbox, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outbox:
        outbox.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for packet in iter(partial(inbox.recv, 1 << 16), end):
            for index, _ in socket.if_nameindex():
                by = struct.pack("8xi", index)  # ip_mreqn
                with suppress(OSError):  # one that is down
                    outbox.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, by)
                    outbox.sendto(packet, (_GROUP, port))


@cache
def _kind(name: str) -> Any:
    """The type of that name."""
    fields = {field: _field(how) for field, how in STORE.fielddefs[name][1]}
    return make_idl_struct(type_name(name), type_name(name).replace("::", "."), fields)


def _field(how: Any) -> Any:
    sort, what = how
    if sort == Nodetype.BASE:
        return _BASES[what[0]]
    if sort == Nodetype.NAME:
        return _kind(what)
    item, size = _field(what[0]), what[1]
    return of.array[item, size] if sort == Nodetype.ARRAY else of.sequence[item]


def _qos(topic: Topic) -> Qos:
    return Qos(
        Policy.Reliability.Reliable(0) if topic.reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if topic.latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(topic.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.IgnoreLocal.Participant,
        Policy.Userdata(f"typehash={STORE.hash_rihs01(topic.kind)};".encode()),
    )


class DdsLink:
    """One participant; ``domain``, where there is one, lives as long as those in it."""

    def __init__(self, number: int, namespace: str, domain: Domain | None) -> None:
        self._domain, self._participant = domain, DomainParticipant(number)
        self._namespace = namespace
        self._writers: dict[Topic, DataWriter[Any]] = {}
        self._readers: dict[Topic, DataReader[Any]] = {}
        self._waits = WaitSet(self._participant)
        self._conditions: list[ReadCondition] = []

    def _topic(self, topic: Topic) -> DdsTopic[Any]:
        name = f"rt{topic.within(self._namespace)}"
        return DdsTopic(self._participant, name, _kind(topic.kind))

    def _writer(self, topic: Topic) -> DataWriter[Any]:
        if topic not in self._writers:
            own = self._topic(topic)
            self._writers[topic] = DataWriter(self._participant, own, qos=_qos(topic))
        return self._writers[topic]

    def advertise(self, topic: Topic) -> None:
        """Show that messages will come."""
        self._writer(topic)

    def publish(self, topic: Topic, data: bytes) -> None:
        """Send a message; a reader that is slow never holds us up."""
        ddspy_write(self._writer(topic)._ref, data + bytes(-len(data) % 4))

    def subscribe(self, topic: Topic) -> None:
        """Listen from now on."""
        if topic in self._readers:
            return
        reader = DataReader(self._participant, self._topic(topic), qos=_qos(topic))
        self._readers[topic] = reader
        self._conditions.append(ReadCondition(reader, _UNREAD))
        self._waits.attach(self._conditions[-1])

    def take(self, topic: Topic) -> list[Taken]:
        """What has come since it was last asked."""
        self.subscribe(topic)
        found = ddspy_take(self._readers[topic]._ref, _ANY, _MOST)
        if isinstance(found, int):
            return []
        return [
            Taken(data, str(info.publication_handle)) for data, info in found if info.valid_data
        ]

    def wait(self, timeout_s: float) -> None:
        """Until something has come, or for so long."""
        self._waits.wait(max(0, round(timeout_s * 1e9)))

    def listeners(self, topic: Topic) -> int:
        """How many readers there are."""
        return len(self._writer(topic).get_matched_subscriptions())

    def close(self) -> None:
        """Leave the network."""
        self._waits, self._conditions = WaitSet(self._participant), []
        self._readers.clear()
        self._writers.clear()
        del self._waits, self._participant, self._domain
