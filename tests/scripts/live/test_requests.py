# SPDX-License-Identifier: Apache-2.0
"""What clients send is read or refused, and nothing else."""

from __future__ import annotations

import json
import math
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scripts.live import published
from scripts.live.requests import (
    MOST_BYTES,
    SERVICES,
    Drive,
    Kidnap,
    MoveDoor,
    Push,
    Run,
    Seek,
    Step,
    Touch,
)
from slam.errors import InvalidValueError


def words(**fields: object) -> bytes:
    return json.dumps(fields).encode()


def test_a_service_reads_its_fields_in_units_of_people():
    assert SERVICES["push"].read("push", b"") == Push()
    asked = words(name="chair1", speed_mps=2, heading_deg=90)
    assert SERVICES["push"].read("push", asked) == Push(
        name="chair1", speed=2.0, heading=math.pi / 2.0
    )
    assert SERVICES["open_door"].read("", words(seconds=5)) == MoveDoor(opened=True, seconds=5.0)
    assert SERVICES["close_door"].read("", b"{}") == MoveDoor(opened=False)
    assert SERVICES["kidnap"].read("", words(goal="kitchen")) == Kidnap(goal="kitchen")
    assert SERVICES["kidnap"].read("", words(x_m=1, y_m=-2)) == Kidnap(pose=(1.0, -2.0, 0.0))
    assert SERVICES["step"].read("", words(scans=3.0)) == Step(scans=3)
    assert SERVICES["seek"].read("", words(back_s=10)) == Seek(back_s=10.0)
    assert SERVICES["pause"].read("", b"") == Run(playing=False)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("push", b"[" * 8000, "no JSON"),
        ("push", b"[1]", "expected a JSON object, got list"),
        ("push", b"\xff\xfe", "no JSON"),
        ("push", b'{"speed_mps": NaN}', "NaN is no number"),
        ("push", b'{"speed_mps": 1e999}', "push.speed_mps must lie in"),
        ("push", b'{"speed_mps": true}', "push.speed_mps must be a number, got True"),
        ("push", words(speed_mps=50), r"must lie in \[0.05, 3\], got 50"),
        ("push", words(name="x" * 101), "a name of up to 100 letters"),
        ("push", words(name="a\nb"), "a name of up to 100 letters"),
        ("push", words(force=1), "no field 'force', fields: name, speed_mps, heading_deg"),
        ("play", words(x=1), "no field 'x', fields: none"),
        ("step", words(scans=1.5), "must be a whole number"),
        ("seek", b"{}", "one of time_s and back_s"),
        ("kidnap", words(x_m=1), "x_m and y_m together"),
        ("kidnap", words(goal="a", x_m=1), "a goal or a pose"),
        ("push", b" " * (MOST_BYTES + 1), "at most 16384 bytes"),
    ],
)
def test_a_service_refuses_what_it_cannot_mean(name, data, said):
    with pytest.raises(InvalidValueError, match=said):
        SERVICES[name].read(name, data)


def test_the_schema_of_a_service_says_what_it_takes():
    schema = json.loads(SERVICES["step"].schema("step"))
    assert schema["properties"]["scans"]["type"] == "integer"
    assert schema["properties"]["scans"]["maximum"] == 1000


def test_topics_of_clients_are_read_as_the_teleop_and_3d_panels_write_them():
    twist = {"linear": {"x": 0.5, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": -1}}
    assert published.read("/cmd_vel", "json", words(**twist)) == Drive(v=0.5, omega=-1.0)
    assert published.read("/cmd_vel", "json", words(twist=twist)) == Drive(v=0.5, omega=-1.0)
    point = {"header": {"frame_id": "map"}, "point": {"x": 1, "y": 2, "z": 0}}
    assert published.read("/touch", "json", words(**point)) == Touch(x=1.0, y=2.0, frame="map")
    turn = {"x": 0, "y": 0, "z": math.sin(0.3), "w": math.cos(0.3)}
    pose = {"position": {"x": 1, "y": 2, "z": 0}, "orientation": turn}
    asked = published.read("/kidnap", "json", words(header={"frame_id": "world"}, pose=pose))
    assert isinstance(asked, Kidnap)
    assert asked.pose == pytest.approx((1.0, 2.0, 0.6))


@pytest.mark.parametrize(
    ("topic", "encoding", "data", "said"),
    [
        ("/rm", "json", b"{}", "nobody listens on '/rm'"),
        ("/cmd_vel", "cdr", b"{}", "must be JSON, got 'cdr'"),
        ("/cmd_vel", "json", b"{}", "a twist has linear and angular"),
        ("/cmd_vel", "json", b'{"linear": 3}', "must be an object, got 3"),
        ("/cmd_vel", "json", b'{"linear": {"x": "1"}}', "must be a number, got '1'"),
        ("/touch", "json", b'{"point": {"x": 1}}', "must have x and y"),
        ("/touch", "json", b'{"point": {"x": 1, "y": 2}, "header": 1}', "must be an object"),
        ("/kidnap", "json", b'{"pose": {}}', "must have x and y"),
    ],
)
def test_a_message_that_is_none_is_refused(topic, encoding, data, said):
    with pytest.raises(InvalidValueError, match=said):
        published.read(topic, encoding, data)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(
        st.sampled_from(["linear", "angular", "twist", "pose", "point", "position", "header",
                         "frame_id", "orientation", "x", "y", "z", "w", "name", "scans"]),
        inner, max_size=4,
    ),
    max_leaves=12,
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(JSON | st.binary(max_size=40))
def test_anything_at_all_is_read_or_refused(what):
    data = what if isinstance(what, bytes) else json.dumps(what).encode()
    readers = [(published.read, (topic, "json", data)) for topic in published.TOPICS]
    readers += [(service.read, (name, data)) for name, service in SERVICES.items()]
    for read, arguments in readers:
        with suppress(InvalidValueError):
            read(*arguments)
