# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def caches(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests, and the commands that they start, leave no rates or fonts in the user's cache."""
    kept = getattr(pytestconfig, "cache", None)  # None: pytest is to keep nothing
    folder = kept.mkdir("user") if kept else tmp_path_factory.mktemp("user")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield
