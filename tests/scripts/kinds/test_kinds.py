# SPDX-License-Identifier: Apache-2.0
"""Each kind of input is read or refused, and it is said, as the page has it."""

import pytest

from slam.errors import MobiliaError
from tests.scripts.kinds.kind import MARK, PAGE, Kind, gathered, is_said, told

ALL = gathered()


@pytest.mark.parametrize("kind", ALL, ids=[kind.name for kind in ALL])
def test_what_is_done_and_said(kind: Kind, tmp_path, caplog):
    path = kind.write(tmp_path)
    if kind.check is None:
        with pytest.raises(MobiliaError) as refused:
            kind.read(path, False)
        assert path.name in str(refused.value) or path.parent.name in str(refused.value)
        assert is_said(kind.said, str(refused.value)), str(refused.value)
        return
    understood, found = kind.read(path, False)
    heard = "\n".join([understood, *(record.getMessage() for record in caplog.records)])
    kind.check(found)
    assert is_said(kind.said, heard), heard
    assert kind.said or not caplog.records, heard
    if kind.strict:
        with pytest.raises(MobiliaError, match="--strict"):
            kind.read(path, True)
    else:
        kind.check(kind.read(path, True)[1])


@pytest.mark.docs
def test_the_page_has_the_table():
    page = PAGE.read_text(encoding="utf-8")
    fill = "python -m tests.scripts.kinds.kind"
    assert f"<!-- {MARK} -->\n\n{told(ALL)}\n\n<!-- /{MARK} -->" in page, f"{fill} fills it"
