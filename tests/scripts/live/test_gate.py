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
    [None, "https://app.foxglove.dev", f"http://127.0.0.1:{PORT}", "https://mine.example:8443"],
)
def test_who_is_named_is_let_in(origin):
    assert is_let_in(RULES, head(origin))


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example", "null", "", "file://", "https://app.foxglove.dev.evil.example",
        "http://app.foxglove.dev", "https://app.foxglove.dev:444", "https://app.foxglove.dev@evil",
        f"http://localhost:{PORT}", f"http://127.0.0.1:{PORT}.evil.example", "http://127.0.0.1",
        "https://mine.example", "https://app.foxglove.dev https://evil.example",
    ],
)  # fmt: skip
def test_pages_of_other_sites_are_refused(origin):
    with pytest.raises(Refused):
        RULES.check(head(origin))


def test_two_origins_a_foreign_name_and_half_a_handshake_are_refused():
    assert not is_let_in(RULES, head("https://app.foxglove.dev", more=["Origin: null"]))
    assert not is_let_in(RULES, head(host=f"evil.example:{PORT}"))  # its name leads here by force
    assert not is_let_in(RULES, head(f"http://evil.example:{PORT}", f"evil.example:{PORT}"))
    assert not is_let_in(RULES, head(more=[f"Host: 127.0.0.1:{PORT}"]))
    assert not is_let_in(RULES, head().replace(b"GET", b"POST"))
    assert not is_let_in(RULES, head().replace(b"websocket", b"h2c"))
    assert not is_let_in(RULES, b"\x16\x03\x01\x02\r\n\r\n")


def test_500_foreign_origins_are_refused():
    rng = random.Random(0)
    good = ["https://app.foxglove.dev", f"http://127.0.0.1:{PORT}", "https://mine.example:8443"]
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
    found = Gate(("127.0.0.1", 0), echo)
    yield found
    found.close()


def asked(port, given):
    client = socket.create_connection(("127.0.0.1", port), timeout=10.0)
    client.sendall(given)
    return client


def test_bytes_are_carried_both_ways(opened):
    given = head(host=f"127.0.0.1:{opened.port}")
    with asked(opened.port, given) as client:
        assert client.recv(4096).startswith(b"GET / HTTP/1.1\r\n")
        client.sendall(b"frames")
        assert client.recv(4096) == b"frames"


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
        Gate(("127.0.0.1", opened.port), echo)
