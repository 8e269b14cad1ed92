# SPDX-License-Identifier: Apache-2.0
"""Who may connect to a live view: pages of other sites may not, whatever they write."""

from __future__ import annotations

import random
import socket
import threading

import pytest

from scripts.live import gate
from scripts.live.gate import Gate, Refused, Rules
from slam.errors import InvalidValueError

PORT = 8765
RULES = Rules(host="127.0.0.1", port=PORT, origins=("https://mine.example:8443",))


def head(origin=None, host=f"127.0.0.1:{PORT}", path="/", more=()):
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade"]
    lines += [] if origin is None else [f"Origin: {origin}"]
    return "\r\n".join([*lines, *more, "", ""]).encode("latin-1")


def is_let_in(rules, given):
    try:
        rules.check(given)
    except Refused:
        return False
    return True


@pytest.mark.parametrize(
    "origin",
    [None, f"http://127.0.0.1:{PORT}", "https://mine.example:8443"],
)
def test_who_is_named_is_let_in(origin):
    assert is_let_in(RULES, head(origin))


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example", "null", "", "file://", "https://mine.example:8443.evil.example",
        "http://mine.example:8443", "https://mine.example:444", "https://mine.example:8443@evil",
        f"http://localhost:{PORT}", f"http://127.0.0.1:{PORT}.evil.example", "http://127.0.0.1",
        "https://mine.example", "https://mine.example:8443 https://evil.example",
    ],
)  # fmt: skip
def test_pages_of_other_sites_are_refused(origin):
    with pytest.raises(Refused):
        RULES.check(head(origin))


def test_two_origins_a_foreign_name_and_half_a_handshake_are_refused():
    assert not is_let_in(RULES, head("https://mine.example:8443", more=["Origin: null"]))
    assert not is_let_in(RULES, head(host=f"evil.example:{PORT}"))  # its name leads here by force
    assert not is_let_in(RULES, head(f"http://evil.example:{PORT}", f"evil.example:{PORT}"))
    assert not is_let_in(RULES, head(more=[f"Host: 127.0.0.1:{PORT}"]))
    assert not is_let_in(RULES, head().replace(b"GET", b"POST"))
    assert not is_let_in(RULES, head().replace(b"websocket", b"h2c"))
    assert not is_let_in(RULES, b"\x16\x03\x01\x02\r\n\r\n")


def test_500_foreign_origins_are_refused():
    rng = random.Random(0)
    good = [f"http://127.0.0.1:{PORT}", "https://mine.example:8443"]
    marks = ["evil.example", *".:@/#?,x0 \t", "%00", "\u00e9"]
    tried = 0
    while tried < 500:
        origin = rng.choice([*good, "http://evil.example", "null"])
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(origin) + 1)
            cut = rng.choice([at, min(at + 1, len(origin))])
            origin = origin[:at] + rng.choice(["", *marks]) + origin[cut:]
        if rng.random() < 0.2:
            origin = origin.swapcase()
        if origin.strip(" \t") in good:
            continue
        tried += 1
        assert not is_let_in(RULES, head(origin)), origin


def test_others_need_the_token_of_the_address():
    token = gate.new_token("0.0.0.0")
    rules = Rules(host="0.0.0.0", port=PORT, token=token)
    host = f"192.168.1.2:{PORT}"
    assert len(token) >= 20
    assert gate.new_token("127.0.0.1") == ""
    assert is_let_in(rules, head(host=host, path=f"/{token}"))
    for path in ("/", f"/{token[:-1]}", f"/{token}x", "/?token=", f"/?token={token}"):
        assert not is_let_in(rules, head(host=host, path=path)), path
    assert not is_let_in(rules, head("http://evil.example", host=host, path=f"/{token}"))
    assert token.encode() not in rules.check(head(host=host, path=f"/{token}"))


def plain(path="/", host=f"127.0.0.1:{PORT}"):
    return f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()


def test_the_page_is_given_to_whom_the_view_is_open_and_nothing_else_is():
    assert RULES.check(plain()) == b""
    assert RULES.check(plain("/?a=b")) == b""
    for path in ("/index.html", "/../etc/passwd", "/%2e%2e/secret", "//x"):
        assert not is_let_in(RULES, plain(path)), path
    assert not is_let_in(RULES, plain(host=f"evil.example:{PORT}"))
    rules = Rules(host="0.0.0.0", port=PORT, token="secret")
    assert rules.check(plain("/secret", "192.168.1.2:1")) == b""
    assert not is_let_in(rules, plain("/", "192.168.1.2:1"))


@pytest.mark.parametrize(
    ("words", "passes"),
    [
        ({"type": "CommandTriggerMessage", "uuid": "x"}, True),
        ({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 3.0}}, True),
        ({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"update_cb": []}}, False),
        ({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": [1] * 99}}, False),
        ({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": "x" * 999}}, False),
        ({"type": "GuiUpdateMessage", "uuid": "x", "updates": 3}, False),
        ({"type": "ShareUrlRequest"}, False),  # would open a tunnel to somebody's server
        ({"type": "FileTransferStartUpload", "size_bytes": 1 << 40}, False),
        ({"type": "RunJavascriptMessage", "source": "alert(1)"}, False),
        ({"type": ["x"]}, False),
        ({}, False),
        ([], False),
    ],
)
def test_messages_of_the_kinds_that_a_view_needs_pass(words, passes):
    msgpack = pytest.importorskip("msgspec.msgpack")
    assert gate.may_pass(msgpack.encode(words)) is passes


def test_500_messages_of_rubbish_are_dropped():
    pytest.importorskip("msgspec.msgpack")
    rng = random.Random(0)
    for _ in range(500):
        assert not gate.may_pass(rng.randbytes(rng.randrange(64)))


@pytest.mark.parametrize("text", ["", "example.org", "https://", "https://a.example/path"])
def test_a_wrong_origin_of_the_user_is_told(text):
    with pytest.raises(InvalidValueError, match="--allow-origin"):
        gate.origin_of(text)


@pytest.fixture
def echo():
    """A server that answers a handshake and says all again."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve(one):
        with one:
            while data := one.recv(4096):
                one.sendall(data)

    def accept():
        while True:
            try:
                one, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=serve, args=(one,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    yield listener.getsockname()[:2]
    listener.close()


@pytest.fixture
def opened(echo):
    found = Gate(("127.0.0.1", 0), echo, b"<html>")
    yield found
    found.close()


def asked(port, given):
    client = socket.create_connection(("127.0.0.1", port), timeout=10.0)
    client.sendall(given)
    return client


def framed(data, first=0x82):
    """A frame as a browser sends it; the mask is zeros."""
    size = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + len(data).to_bytes(2)
    return bytes([first]) + size + bytes(4) + data


def test_messages_are_carried_and_those_of_other_kinds_are_not(opened):
    msgpack = pytest.importorskip("msgspec.msgpack")
    good, bad = (
        framed(msgpack.encode({"type": kind, "uuid": "x" * 200}))
        for kind in ("CommandTriggerMessage", "ShareUrlRequest")
    )
    given = head(host=f"127.0.0.1:{opened.port}")
    with asked(opened.port, given) as client:
        assert client.recv(4096).startswith(b"GET / HTTP/1.1\r\n")
        client.sendall(bad + good)
        assert client.recv(4096) == good


@pytest.mark.parametrize(
    "frame",
    [
        b"\x82\xff" + (1 << 40).to_bytes(8),  # a terabyte is coming
        b"\x82\xfe" + (60_000).to_bytes(2),
        framed(b"part", 0x02),  # one of many that would be put together
        framed(b"text", 0x81),
        b"\x82\x04data",  # without a mask
        framed(b"reserved", 0xC2),
    ],
)
def test_frames_that_no_page_sends_end_the_connection(opened, frame):
    with asked(opened.port, head(host=f"127.0.0.1:{opened.port}")) as client:
        assert client.recv(4096).startswith(b"GET / HTTP/1.1\r\n")
        client.sendall(frame)
        assert client.recv(4096) == b""


def test_a_browser_gets_the_page(opened):
    with asked(opened.port, plain(host=f"127.0.0.1:{opened.port}")) as client:
        whole = b""
        while data := client.recv(4096):
            whole += data
    assert whole.startswith(b"HTTP/1.1 200 OK\r\n")
    assert whole.endswith(b"\r\n\r\n<html>")


def test_nothing_of_a_foreign_page_reaches_the_server(opened):
    given = head("http://evil.example", f"127.0.0.1:{opened.port}")
    with asked(opened.port, given + b"push") as client:
        assert client.recv(4096).startswith(b"HTTP/1.1 403 ")
        assert client.recv(4096) == b""


def test_so_many_clients_and_no_more(opened):
    given = head(host=f"127.0.0.1:{opened.port}")
    clients = [asked(opened.port, given) for _ in range(gate.MOST_CLIENTS)]
    try:
        for client in clients:
            assert client.recv(4096).startswith(b"GET ")
        with asked(opened.port, given) as one_more:
            assert one_more.recv(4096).startswith(b"HTTP/1.1 503 ")
    finally:
        for client in clients:
            client.close()


def test_a_port_that_is_taken_is_told(opened, echo):
    with pytest.raises(InvalidValueError, match="cannot listen at 127"):
        Gate(("127.0.0.1", opened.port), echo, b"")
