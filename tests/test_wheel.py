# SPDX-License-Identifier: Apache-2.0
"""What is installed is all of mobilia, and works where nothing else of it is.

``.ci/wheel`` goes on from here: an empty virtual environment, and the demo in it.
"""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from mobilia import PACKAGES

pytestmark = pytest.mark.docs
REPO = Path(__file__).resolve().parents[1]
LEFT_OUT = {"__pycache__"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, unpacked: as pip lays it out."""
    out = tmp_path_factory.mktemp("wheel")
    built = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(out)],
        cwd=REPO, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    (file,) = out.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(out / "site")
    return out / "site"


def python(wheel: Path, folder: Path, *words: str, first: str = "") -> subprocess.CompletedProcess:
    """Python in ``folder``, with what is in the wheel and nothing of the checkout."""
    path = os.pathsep.join(filter(None, [first, str(wheel)]))
    return subprocess.run(
        [sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "", "COLUMNS": "200"},
        timeout=120,
    )  # fmt: skip


def test_every_file_of_the_packages_is_in_it(wheel: Path):
    for package in ("mobilia", *PACKAGES):
        ours = {
            path.relative_to(REPO)
            for path in (REPO / package).rglob("*")
            if path.is_file() and not LEFT_OUT & set(path.parts)
        }
        packed = {path.relative_to(wheel) for path in (wheel / package).rglob("*.*")}
        assert {p for p in ours if p.suffix in (".py", ".xml", ".css", ".html")} <= packed
        assert not any(path.parts[0] in ("tests", "docs") for path in packed)
    (entry,) = wheel.glob("*.dist-info/entry_points.txt")
    assert "mobilia = mobilia.__main__:main" in entry.read_text()


def test_it_works_from_another_folder(wheel: Path, tmp_path: Path):
    listed = python(wheel, tmp_path, "-m", "mobilia", "list")
    assert listed.returncode == 0, listed.stderr
    assert "mobilia/Office-v2" in listed.stdout
    code = (
        "import sys, gymnasium, sim; from pathlib import Path\n"
        "assert Path(sim.__file__).parents[1] == Path(sys.argv[1])\n"
        "print(gymnasium.spec('mobilia/Office-v2').id)"
    )
    done = python(wheel, tmp_path, "-c", code, str(wheel))
    assert done.returncode == 0, done.stderr
    assert done.stdout == "mobilia/Office-v2\n"


def test_a_folder_without_a_package_hides_nothing(wheel: Path, tmp_path: Path):
    for name in PACKAGES:
        (tmp_path / name).mkdir()
    done = python(wheel, tmp_path, "-m", "mobilia", "list", first=str(tmp_path))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("name", "on_path"), [("scripts", True), ("sim", False)])
def test_a_package_of_that_name_gets_one_sentence(wheel, tmp_path, name: str, on_path: bool):
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("raise SystemExit('of the user')\n")
    first = str(tmp_path) if on_path else ""  # else it is there by Python's "here"
    done = python(wheel, tmp_path, "-m", "mobilia", "list", first=first)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"mobilia: {tmp_path / name} hides the package '{name}' of mobilia: rename it, or keep "
        f"{tmp_path} off Python's path (PYTHONPATH, or start elsewhere)\n"
    )


def test_a_module_and_a_missing_package_get_a_sentence_too(wheel: Path, tmp_path: Path):
    (tmp_path / "scenes.py").write_text("")
    done = python(wheel, tmp_path, "-c", "import sim")
    assert done.stderr.splitlines()[-1].startswith(
        f"ImportError: {tmp_path / 'scenes.py'} hides the package 'scenes' of mobilia: rename it"
    )
    code = "import sys, mobilia; sys.path.remove(sys.argv[1]); print(mobilia.hidden('slam'))"
    done = python(wheel, tmp_path, "-c", code, str(wheel))
    assert done.returncode == 0, done.stderr
    assert "hides the package 'slam'" in done.stdout or "is missing in" in done.stdout


def pins(name: str) -> set[str]:
    text = (REPO / name).read_text().replace("\\\n", " ")
    return {re.sub(r" ;.*?(?= --hash)", "", " ".join(x.split())) for x in text.splitlines()}


def test_the_lock_of_what_ci_adds_has_the_extra_at_the_versions_of_the_lock():
    project = tomllib.loads((REPO / "pyproject.toml").read_text())
    extras, ci = project["project"]["optional-dependencies"], pins("requirements-ci.lock")
    for extra in ("ros2", "data", "tune"):
        assert {*extras[extra]} < {*project["dependency-groups"]["ci"]}
    assert {"cyclonedds", "eclipse-zenoh", "optuna", "uv"} <= {
        re.split(r"[=\[ ]", pin)[0] for pin in ci
    }
    known = pins("requirements.lock")
    names = {re.split(r"[=\[ ]", pin)[0] for pin in known}
    assert {pin for pin in ci if re.split(r"[=\[ ]", pin)[0] in names} <= known


@pytest.mark.parametrize("name", sorted(path.name for path in REPO.glob("requirements*.lock")))
def test_every_line_of_a_lock_has_a_hash_and_none_an_address(name: str):
    assert all("==" in pin and " --hash=sha256:" in pin for pin in pins(name))
    assert "://" not in (REPO / name).read_text()


def test_nothing_is_installed_without_hashes():
    """``pip install`` in what sets up, tests and locks: ours alone, which has none."""
    for name in ("Makefile", ".ci/run", ".ci/wheel"):
        text = (REPO / name).read_text().replace("$(PIP)", "pip install")
        for line in text.splitlines():
            if "pip install" in line and not line.startswith(("PIP ", "#")):
                assert "--require-hashes" in line or "--no-deps" in line, line


def test_the_lock_of_what_runs_is_a_part_of_the_lock():
    run, whole = pins("requirements-run.lock"), pins("requirements.lock")
    assert run <= whole
    names = {re.split(r"[=\[ ]", pin)[0] for pin in run}
    assert {"mujoco", "numba", "hatchling", "editables", "packaging"} <= names
    assert not {"pytest", "mypy", "pandas", "evo", "dask", "kiss-icp"} & names
