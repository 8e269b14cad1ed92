# SPDX-License-Identifier: Apache-2.0
"""One writer at a time, and none while workers of an earlier one have not ended."""

import pytest

from slam import locks
from slam.errors import OutputError


def test_two_writers_are_refused_and_nothing_stays(tmp_path):
    with (
        locks.locked(tmp_path),
        pytest.raises(OutputError, match="is being written by another process"),
        locks.locked(tmp_path),
    ):
        pass
    with locks.locked(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_worker_that_is_left_keeps_the_next_writer_out(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "WAIT_S", 0.1)
    with locks.locked(tmp_path):
        ticket = locks.ticket(tmp_path)
        left = locks.working(tmp_path, ticket)
        left.__enter__()
    assert (tmp_path / locks.WORKERS).exists()  # the writer is over, its worker is not
    with (
        pytest.raises(OutputError, match="still being written by workers of an earlier command"),
        locks.locked(tmp_path),
    ):
        pass
    left.__exit__(None, None, None)
    with locks.locked(tmp_path):
        assert locks.ticket(tmp_path) != ticket
    assert not list(tmp_path.iterdir())


def test_a_worker_with_an_old_ticket_does_nothing(tmp_path):
    with locks.locked(tmp_path):
        old = locks.ticket(tmp_path)
    for _ in range(2):
        with (
            pytest.raises(OutputError, match="taken up by another command"),
            locks.working(tmp_path, old),
        ):
            raise AssertionError("it works")
        (tmp_path / locks.WORKERS).write_text("another")


def test_workers_share(tmp_path):
    with locks.locked(tmp_path):
        ticket = locks.ticket(tmp_path)
        with locks.working(tmp_path, ticket), locks.working(tmp_path, ticket):
            assert not locks.idle(tmp_path, wait_s=0.0)
        assert locks.idle(tmp_path)


def test_what_a_killed_writer_left_is_no_obstacle(tmp_path):
    for name in locks.NAMES:
        (tmp_path / name).write_text("left")
    with locks.locked(tmp_path):
        assert locks.ticket(tmp_path) not in ("", "left")
    assert not list(tmp_path.iterdir())
