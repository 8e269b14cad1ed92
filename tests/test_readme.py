# SPDX-License-Identifier: Apache-2.0
"""README and docs do what they say: their Python blocks run, their links lead somewhere."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.processes import python

pytestmark = pytest.mark.docs
REPO = Path(__file__).resolve().parents[1]
README = (REPO / "README.md").read_text()
DOCS = REPO / "docs"
PAGES = [REPO / "README.md", REPO / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]


def blocks(page: str) -> list[str]:
    """The Python of a page in ``docs``."""
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), flags=re.DOTALL)


def run(*command: str) -> str:
    return str(python(*command).stdout)


@pytest.mark.filterwarnings("ignore")
def test_the_code_of_the_readme_runs_and_prints_what_stands_beside_it(capsys):
    for block in blocks("../README.md"):
        exec(block, {})
        assert capsys.readouterr().out.splitlines() == re.findall(r"^print.*  # (.*)$", block, re.M)


def test_the_front_page_of_the_site_has_the_jobs_of_the_readme():
    (jobs,) = re.findall(r"\| your job .*?\n\n", README, flags=re.DOTALL)
    assert jobs.replace("](docs/", "](") in (DOCS / "index.md").read_text()


def test_the_citation_is_of_this_version():
    project = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]
    cited = yaml.safe_load((REPO / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} < cited.keys()  # what it must have
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    assert cited["authors"] == project["authors"]


@pytest.mark.filterwarnings("ignore")
def test_the_environment_examples_run():
    (block,) = blocks("gymnasium.md")
    exec(block, {})
    page = (DOCS / "gymnasium.md").read_text()
    (call,) = re.findall(r"^    (gymnasium\.make_vec\(.*\))$", page, flags=re.MULTILINE)
    exec(f"import gymnasium, sim\n{call}.reset(seed=1)", {})


def test_the_stream_example_ends_near_the_truth(capsys: pytest.CaptureFixture[str]):
    (block,) = blocks("streams.md")
    exec(block, {})
    printed = capsys.readouterr().out
    numbers = [float(word) for word in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", printed)]
    assert max(abs(a - b) for a, b in zip(numbers[:3], numbers[3:], strict=True)) < 0.05


def test_slam_needs_no_simulator():
    forbidden = "('mujoco', 'gymnasium', 'sim', 'scenes')"
    code = (
        "import importlib, pkgutil, sys, slam\n"
        "for m in pkgutil.walk_packages(slam.__path__, 'slam.'):\n"
        "    try: importlib.import_module(m.name)\n"
        "    except ModuleNotFoundError as e: assert e.name in ('cyclonedds', 'zenoh'), e\n"
        f"print([name for name in {forbidden} if name in sys.modules])"
    )
    assert run("-c", code).strip() == "[]"


def test_every_dependency_is_explained():
    project = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]
    explained = re.findall(
        r"^\| `([\w.-]+)` \| \w.* \|$", (DOCS / "dependencies.md").read_text(), re.M
    )
    needed = [re.split("[<>=]", requirement)[0] for requirement in project["dependencies"]]
    assert sorted(explained) == sorted(needed)
    assert "](docs/dependencies.md)" in README


def test_the_index_lists_every_page():
    linked = set(re.findall(r"\]\(([\w/]+\.md)\)", (DOCS / "index.md").read_text()))
    pages = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    assert pages - linked == {"index.md"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPO).as_posix())
def test_every_link_leads_somewhere(page: Path):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(REPO).as_posix())
def test_every_file_of_code_that_a_page_names_exists(page: Path):
    for name in re.findall(r"`((?:slam|sim|scenes|scripts|tests)/[\w/.]+)`", page.read_text()):
        assert "NAME" in name or (REPO / name).exists(), f"{page.name} names {name}"


def test_the_claims_name_code_and_tests_that_exist():
    text = (DOCS / "paper" / "claims.md").read_text()
    for name in re.findall(r"`((?:map|matching|tracking)/\w+\.py|featured\.py)`", text):
        assert (REPO / "slam" / "shunting" / name).exists(), name
    tests = sorted((REPO / "tests").rglob("test_*.py"))
    code = "\n".join(path.read_text() for path in tests)
    for name in re.findall(r"`(test_\w+\.py)`", text):
        assert name in {path.name for path in tests}, name
    for name in re.findall(r"`(test_\w+)`", text):
        assert f"def {name}(" in code, name


def test_the_dataset_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """As printed, but shorter episodes and no film."""
    from typer.testing import CliRunner

    from scripts.cli import app

    section = (DOCS / "datasets.md").read_text().split("## Make one")[1].split("\n## ")[0]
    assert len(section.strip().splitlines()) <= 10
    commands = re.findall(r"\.venv/bin/mobilia ([^#\n]+)", section)
    assert [command.split()[0] for command in commands] == ["generate", "verify", "export", "run"]
    monkeypatch.chdir(tmp_path)
    for command in commands:
        short = command.replace("--seconds 20", "--seconds 1").replace(
            "--episodes 4", "--episodes 2"
        )
        words = short.split()
        words += ["--no-film"] if words[0] == "run" else []
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "office" / "SHA256SUMS").exists()
    assert (tmp_path / "out" / "office-d0.5-s0001.log.gz").exists()
    done = CliRunner().invoke(app, ["verify", "out/office"])  # an export is no part of it
    assert done.exit_code == 0, done.output
