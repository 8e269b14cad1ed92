# SPDX-License-Identifier: Apache-2.0
"""Who may connect to a live view: pages of other sites may not, whatever they write."""

import socket
import threading
import time
from types import SimpleNamespace

import pytest
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import serve

from scripts.live import served
from scripts.live.served import Gate, Refused, Rules
from slam.errors import InvalidValueError

PORT, FLOOD, VERSION = 8765, 1 << 18, "viser-v1"
RULES = Rules(host="127.0.0.1", port=PORT, origins=("https://mine.example:8443",))


def is_let_in(rules, origin=None, host=f"127.0.0.1:{PORT}", path="/", more=(), upgrade=True):
    headers = Headers([("Host", host), *more])
    headers.update({"Upgrade": "websocket"} if upgrade else {})
    if origin is not None:
        headers["Origin"] = origin
    try:
        assert rules.check(path, headers) is not upgrade
    except Refused:
        return False
    return True


@pytest.mark.parametrize("origin", [None, f"http://127.0.0.1:{PORT}", "https://mine.example:8443"])
def test_who_is_named_is_let_in(origin):
    assert is_let_in(RULES, origin)


@pytest.mark.parametrize(
    "asks",
    [
        *({"origin": origin} for origin in (
            "http://evil.example", "null", "", "https://mine.example:8443.evil.example",
            "http://mine.example:8443", "https://mine.example:444", f"http://localhost:{PORT}",
            f"http://127.0.0.1:{PORT}.evil.example", "http://127.0.0.1",
            "https://mine.example:8443 https://evil.example",
        )),
        {"origin": "https://mine.example:8443", "more": [("Origin", "null")]},
        {"host": f"evil.example:{PORT}"},  # its name leads here by force
        {"host": f"evil.example:{PORT}", "origin": f"http://evil.example:{PORT}"},
        {"host": f"evil.example:{PORT}", "upgrade": False},
        {"more": [("Host", f"127.0.0.1:{PORT}")]},
    ],
)  # fmt: skip
def test_pages_of_other_sites_and_foreign_names_are_refused(asks):
    assert not is_let_in(RULES, **asks)


def test_others_need_the_token_of_the_address():
    token = served.new_token("0.0.0.0")
    rules = Rules(host="0.0.0.0", port=PORT, token=token)
    host = f"192.168.1.2:{PORT}"
    assert len(token) >= 20
    assert served.new_token("127.0.0.1") == ""
    for upgrade in (True, False):
        assert is_let_in(rules, host=host, path=f"/{token}", upgrade=upgrade)
        assert not is_let_in(rules, host=host, upgrade=upgrade)
    for path in (f"/{token[:-1]}", f"/{token}x", "/?token=", f"/?token={token}"):
        assert not is_let_in(rules, host=host, path=path), path
    assert not is_let_in(rules, "http://evil.example", host, f"/{token}")


def test_the_page_is_given_to_whom_the_view_is_open_and_nothing_else_is():
    assert is_let_in(RULES, path="/?a=b", upgrade=False)
    for path in ("/index.html", "/../etc/passwd", "/%2e%2e/secret", "//x"):
        assert not is_let_in(RULES, path=path, upgrade=False), path


@pytest.mark.parametrize("text", ["", "example.org", "https://", "https://a.example/path"])
def test_a_wrong_origin_of_the_user_is_told(text):
    with pytest.raises(InvalidValueError, match="--allow-origin"):
        served.origin_of(text)


@pytest.fixture
def echo():
    """A server that says all again, and floods whoever asks for it."""

    def answer(connection):
        heard.append(connection.request.headers.get_all(served.SECRET))
        for message in connection:
            connection.send(message)
            while b"flood" in message:
                connection.send(bytes(FLOOD))
                heard.append(FLOOD)

    heard = []
    with serve(answer, "127.0.0.1", 0, subprotocols=[VERSION], compression=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield SimpleNamespace(address=server.socket.getsockname()[:2], heard=heard)
        server.shutdown()


@pytest.fixture
def opened(echo):
    found = Gate(
        ("127.0.0.1", 0), echo.address, b"<html>", lambda m: b"bad" not in m, speaks=VERSION,
        secret="known",
    )  # fmt: skip
    yield found
    found.close()


def asked(opened, **options):
    options = {"subprotocols": [VERSION], "compression": None, "proxy": None, **options}
    return connect(f"ws://127.0.0.1:{opened.port}", **options)


def framed(data, first=0x82):
    """A frame as a browser sends it; the mask is zeros."""
    size = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + len(data).to_bytes(2)
    return bytes([first]) + size + bytes(4) + data


def test_messages_that_are_admitted_are_carried_and_others_are_not(opened, echo):
    with asked(opened, additional_headers={served.SECRET: "guess"}) as client:
        client.send(b"bad")
        client.send(b"good")
        assert client.recv(timeout=10.0) == b"good"
    assert echo.heard == [["known"]]


@pytest.mark.parametrize(
    "frame",
    [
        b"\x82\xff" + (1 << 40).to_bytes(8),  # a terabyte is coming
        framed(bytes(4000), 0x02) + framed(bytes(4000), 0x80),  # parts that make too much
        framed(b"text", 0x81),
        b"\x82\x04data",  # without a mask
    ],
)
def test_frames_that_no_page_sends_end_the_connection(opened, frame):
    with asked(opened) as client:
        client.socket.sendall(frame)
        with pytest.raises(ConnectionClosed):
            client.recv(timeout=10.0)


def answered(port, given):
    """All that comes back."""
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as client:
        client.sendall(given)
        whole = b""
        while data := client.recv(4096):
            whole += data
    return whole


def test_a_browser_gets_the_page_and_rubbish_nothing(opened):
    asks = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{opened.port}\r\n\r\n".encode()
    whole = answered(opened.port, asks)
    assert whole.startswith(b"HTTP/1.1 200 OK\r\n")
    assert whole.endswith(b"\r\n\r\n<html>")
    for rubbish in (asks.replace(b"GET", b"POST"), b"\x16\x03\x01\x02\r\n\r\n"):
        assert b"<html>" not in answered(opened.port, rubbish)


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ({"origin": "http://evil.example"}, "403"),
        ({"subprotocols": None}, "400"),
        ({"subprotocols": ["viser-v0.9"]}, "400"),
        ({"subprotocols": ["x" * 2000]}, "400"),
    ],
)
def test_the_server_hears_nothing_of_a_foreign_page_or_another_version(
    opened, echo, options, status
):
    with pytest.raises(InvalidStatus, match=status):
        asked(opened, **options)
    assert echo.heard == []


def test_a_hundred_clients_are_told_that_eight_are_there(opened):
    clients = [asked(opened) for _ in range(served.MOST_CLIENTS)]
    try:
        for _ in range(100):
            with pytest.raises(InvalidStatus, match="503"):
                asked(opened)
    finally:
        for client in clients:
            client.close()


def test_what_waits_for_a_client_that_does_not_read_is_bounded(opened, echo):
    with asked(opened, max_queue=1, close_timeout=0.1) as client:
        client.send(b"flood")
        sent = [-1, 0]
        while sent[-1] != sent[-2]:  # until nothing more goes in
            time.sleep(0.5)
            sent.append(sum(echo.heard[1:]))
        assert sent[-1] < 256 * FLOOD  # what kernel (17 MB here), gate and client hold


def test_a_port_that_is_taken_is_told(opened, echo):
    with pytest.raises(InvalidValueError, match="cannot listen at 127"):
        Gate(("127.0.0.1", opened.port), echo.address, b"", bool, speaks=VERSION)
