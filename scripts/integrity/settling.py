# SPDX-License-Identifier: Apache-2.0
"""Cases in files: what is done is not done again, unless the code is another."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scripts.integrity.losses import run
from scripts.integrity.ways import Case
from scripts.machine import versions
from scripts.names import file_name
from scripts.output import configs_of
from scripts.result_files import ROOT, write
from slam.files import make_folder

CODE = (
    "slam", "scripts/integrity", "scripts/metrics", "scripts/experiments/kidnap.py",
    "scripts/experiments/honesty.py",
)  # fmt: skip
NOT_CODE = (  # of ``scripts/integrity``: they only sum up, or fit
    "campaign.py", "tables.py", "fit.py", "labelled.py", "sources.py", "weights.py",
    "reliability.py", "belief_picture.py",
)  # fmt: skip


def path_of(case: Case, folder: Path) -> Path:
    """The file of a case."""
    return folder / file_name(case.slam) / case.way / f"{case.number:06d}.json"


@functools.cache
def code() -> str:
    """SHA-256 of the source files that a case depends on."""
    digest = hashlib.sha256()
    for part in CODE:
        place = ROOT / part
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            if path.parent != ROOT / "scripts" / "integrity" or path.name not in NOT_CODE:
                digest.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def digest_of(case: Case) -> str:
    """What the result of a case depends on: itself, the stream, the config, and the code."""
    spec = "" if case.log else asdict(case.spec) | {"settings": asdict(case.spec.settings)}
    words = [asdict(case), spec, configs_of([case.slam]), versions()["mobilia"], code()]
    return hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()


def settled(case: Case, folder: Path) -> dict[str, Any] | None:
    """The file of a case; None where it is not there or was made by other code."""
    try:
        row = json.loads(path_of(case, folder).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return row if isinstance(row, dict) and row.get("digest") == digest_of(case) else None


def settle(case: Case, folder: Path) -> Case:
    """Run a case and write its file."""
    path = path_of(case, folder)
    make_folder(path.parent)
    write(path, {"digest": digest_of(case), "case": asdict(case), **run(case)}, {})
    return case
