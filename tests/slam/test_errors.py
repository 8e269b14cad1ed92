# SPDX-License-Identifier: Apache-2.0
"""Messages are one line that a terminal shows and does not obey, whoever's words are in them."""

import inspect
import pickle

import pytest

from slam import errors
from slam.errors import LogFormatError, MobiliaError, SlamFailedError, printable

OBEYED = "a\x1b[2J\x07\r\nb\x9b31m\u202egnp.exe\u2066\x00\x7f\u2028\udc80"
SHOWN = "a\\x1b[2J\\x07\\r\\nb\\x9b31m\\u202egnp.exe\\u2066\\x00\\x7f\\u2028\\udc80"


def test_what_does_not_print_is_its_escape():
    assert printable(OBEYED) == SHOWN
    assert printable(SHOWN) == SHOWN
    assert printable("5 °, ∞, 東京 …") == "5 °, ∞, 東京 …"


@pytest.mark.parametrize(
    "kind",
    [
        kind
        for _, kind in inspect.getmembers(errors, inspect.isclass)
        if issubclass(kind, MobiliaError) and not issubclass(kind, LogFormatError)
    ],
)
def test_no_error_carries_what_a_terminal_obeys(kind):
    error = kind(OBEYED)
    assert str(error) == SHOWN
    assert str(pickle.loads(pickle.dumps(error))) == SHOWN


def test_nor_does_the_part_of_one_that_tables_keep():
    failed = SlamFailedError(OBEYED)
    assert failed.message == SHOWN
    assert failed.at("scan 3,").message == f"scan 3, {SHOWN}"
    log = LogFormatError("a\x1b.log", OBEYED, 7)
    assert (str(log), log.message) == (f"a\\x1b.log:7: {SHOWN}", SHOWN)
    assert str(log.path) == "a\x1b.log"
    assert str(pickle.loads(pickle.dumps(log))) == str(log)
