# SPDX-License-Identifier: Apache-2.0
"""``mobilia doctor`` says what is there, what is not, and how to get it."""

import os
import tomllib
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import joblib
import pytest

from scripts.doctor import checks
from sim.view import gl

pytestmark = pytest.mark.slow


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Versions by package, to be changed; what mobilia requires is four of them."""
    versions = {"mobilia": "1.0", "numpy": "2.2", "numba": "0.63"}
    requires = ["numpy>=2.2", "numba>=0.63", "kiss-icp>=1.3; extra == 'guests'",
                "old>=1; python_version < '3' and extra == 'yag'"]  # fmt: skip

    def version(name: str) -> str:
        if name not in versions:
            raise metadata.PackageNotFoundError(name)
        return versions[name]

    def told(name: str) -> SimpleNamespace:
        version(name)
        return SimpleNamespace(get_all=lambda _: ["guests", "yag", "rl"])

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(metadata, "requires", lambda name: version(name) and requires)
    monkeypatch.setattr(metadata, "metadata", told)
    monkeypatch.setattr(gl, "find", lambda: gl.Gl(backend=None, reason="no GL library"))
    return versions


def found() -> dict[str, checks.Finding]:
    return {finding.what: finding for finding in checks.findings()}


def test_each_thing_is_there_or_the_way_to_it_is_named(installed):
    told = found()
    assert (told["numpy"].state, told["numpy"].found) == ("ok", "2.2")
    assert told["3D pictures (OpenGL)"].state == "can do without"
    assert "no GL library" in told["3D pictures (OpenGL)"].found
    assert "apt-get install libegl1" in told["3D pictures (OpenGL)"].how
    assert told["[guests]"].how == "pip install 'mobilia[guests]'"
    assert "no wheels for this Python" in told["[yag]"].found
    assert told["[cluster]"].how == "install it again"  # the installed one is older than that
    assert told["cores"].found.startswith(f"{joblib.cpu_count()} ")
    assert told["films (ffmpeg)"].state == "ok"
    assert all(finding.how for finding in told.values() if finding.state != "ok")


def test_every_extra_is_looked_at():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())
    assert set(checks.EXTRAS) == set(project["project"]["optional-dependencies"])


def test_what_is_too_old_or_not_there_is_missing(installed):
    installed["numpy"] = "1.26"
    del installed["numba"]
    told = found()
    assert (told["numpy"].state, told["numpy"].found) == ("missing", "is 1.26, needed is >=2.2")
    assert told["numpy"].how == "pip install 'numpy>=2.2'"
    assert (told["numba"].state, told["numba"].found) == ("missing", "is not installed")
    del installed["mobilia"]
    assert found()["mobilia"].found == "is not installed"


def test_the_command_ends_with_1_where_something_needed_is_missing(called, installed):
    done = called("doctor")
    assert done.returncode == 0, done.stderr
    assert "✓ numpy" in done.stdout
    assert "    to get it: pip install 'mobilia[guests]'" in done.stdout
    del installed["numba"]
    done = called("doctor")
    assert done.returncode == 1
    assert done.stderr == "mobilia: needed and missing: numba\n"


def test_sizes_are_those_of_the_files(called):
    files = metadata.files("llvmlite") or ()
    ours = sum(os.lstat(f.locate()).st_size for f in files if os.path.lexists(f.locate()))
    done = called("doctor", "--sizes")
    assert done.returncode == 0
    (row,) = (line for line in done.stdout.splitlines() if "llvmlite" in line)
    assert f" {ours / 1e6:.0f} " in row
    assert "MB in all" in done.stdout
