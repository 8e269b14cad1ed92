# SPDX-License-Identifier: Apache-2.0
"""The site: every page has its place, its commands are commands, and its check finds faults.

``make docs`` builds it (mkdocs is no part of the test environment).
"""

import re
import shlex
from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

from scripts.cli import app
from scripts.site.check import faults, main

pytestmark = pytest.mark.docs
REPO = Path(__file__).resolve().parents[1]
DOCS = REPO / "docs"
CONFIG = yaml.safe_load((REPO / "mkdocs.yml").read_text())
GENERATED = {"contributing.md", "changelog.md", "results.md"}  # by scripts/site/hooks.py
JOBS = ["start.md", *(f"jobs/my_{job}.md" for job in ("slam", "dataset", "log", "policy", "scene"))]


def in_nav(entry: object) -> list[str]:
    if isinstance(entry, dict):
        (entry,) = entry.values()
    return [entry] if isinstance(entry, str) else [page for one in entry for page in in_nav(one)]


def test_every_page_has_one_place_in_the_navigation():
    pages = [page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")]
    assert sorted(in_nav(CONFIG["nav"])) == sorted([*pages, *GENERATED]), "see nav in mkdocs.yml"


def test_the_site_is_strict_and_has_no_fonts_from_elsewhere():
    assert CONFIG["strict"] is True
    assert set(CONFIG["validation"].values()) == {"warn"}  # which strict makes errors: broken links
    assert CONFIG["theme"]["font"] is False
    assert not {"extra_javascript", "google_analytics", "repo_url"} & CONFIG.keys()


def test_search_works_from_disk_with_a_script_of_ours():
    assert {"search", "offline"} <= {one for one in CONFIG["plugins"] if isinstance(one, str)}
    (script,) = CONFIG["extra"]["polyfills"]
    assert "iframe-worker" in script  # else the plugin adds one from elsewhere
    assert (DOCS / script).is_file()


GOOD = """<html><head><link rel="canonical" href="https://example.org/a">
<link rel="stylesheet" href="a.css">
<style>p { background: url(data:image/png;base64,AA==) }</style></head><body><h1 id="top">x</h1>
<a href="https://example.org">elsewhere</a><a href="#top">up</a><a href="other.html#there">on</a>
<img src="a%20b.png"></body></html>"""
WRONG = {
    '<script src="https://cdn.example.org/x.js"></script>': "loads https://cdn.example.org/x.js",
    '<link rel="stylesheet" href="//fonts.example.org/f.css">': "loads //fonts.example.org/f.css",
    '<link rel="preconnect" href="https://example.org">': "loads https://example.org",
    '<img src="http://example.org/p.png">': "loads http://example.org/p.png",
    '<img srcset="a.css 1x, https://example.org/p.png 2x">': "loads https://example.org/p.png",
    '<video poster="https://example.org/p.png"></video>': "loads https://example.org/p.png",
    "<p style=\"background: url('https://example.org/p.png')\">": "loads https://example.org/p.png",
    "<style>@import 'https://example.org/f.css';</style>": "loads https://example.org/f.css",
}


def built(folder: Path, page: str) -> Path:
    (folder / "index.html").write_text(page)
    (folder / "a.css").write_text("p { color: red }")
    return folder


def test_a_sound_site_has_no_faults(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    site = built(tmp_path, GOOD)
    assert list(faults(site)) == []
    assert main([str(site)]) == 0
    assert "1 pages" in capsys.readouterr().out
    assert main([str(tmp_path / "nowhere")]) == 2


@pytest.mark.parametrize("wrong", WRONG)
def test_a_fault_is_named(tmp_path: Path, wrong: str, capsys: pytest.CaptureFixture[str]):
    site = built(tmp_path, GOOD.replace("</body>", f"{wrong}</body>"))
    (fault,) = faults(site)
    assert fault.startswith(f"index.html {WRONG[wrong]}")
    assert main([str(site)]) == 1
    assert fault in capsys.readouterr().err


def test_a_stylesheet_that_loads_from_elsewhere_is_named(tmp_path: Path):
    site = built(tmp_path, GOOD)
    (site / "a.css").write_text("@font-face { src: url(https://example.org/f.woff2) }")
    assert list(faults(site)) == ["a.css loads https://example.org/f.woff2"]


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(), flags=re.DOTALL)


@pytest.mark.parametrize("page", [*JOBS, "gallery.md"])
def test_the_commands_are_commands(page: str):
    """Their verbs, arguments and options are there; other tests run them."""
    group = typer.main.get_command(app)
    text = "".join(blocks(page, "sh")).replace("\\\n", " ")
    lines = text.splitlines()
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("mobilia ")]
    assert commands or page == "jobs/my_policy.md"
    for verb, *words in commands:
        group.commands[verb].make_context(verb, words)
    others = {shlex.split(line)[0] for line in lines} - {"mobilia"}
    assert others <= {"make", "source", "python"}


@pytest.mark.parametrize("block", range(3))
def test_the_policy_blocks_run(block: int, capsys: pytest.CaptureFixture[str]):
    exec(blocks("jobs/my_policy.md", "python")[block].replace("range(100)", "range(10)"), {})
    printed = capsys.readouterr().out.strip()
    assert printed
    assert block or f"It prints `{printed}`" in (DOCS / "jobs/my_policy.md").read_text()


def test_the_dataset_blocks_run(tmp_path, monkeypatch, capsys):
    """On shorter episodes, where the extra ``data`` is."""
    pytest.importorskip("minari")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")  # which the page sets
    text = "".join(blocks("jobs/my_dataset.md", "sh")).replace("train:8,test:2", "train:1,test:1")
    lines = [line for line in text.splitlines() if "--format" in line]
    for line, code in zip(lines, blocks("jobs/my_dataset.md", "python"), strict=True):
        short = re.sub(r"--seconds \d+", "--seconds 1", line)
        done = CliRunner().invoke(app, shlex.split(short)[1:], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        exec(code, {})
        assert ", 361)" in capsys.readouterr().out
