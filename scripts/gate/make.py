# SPDX-License-Identifier: Apache-2.0
"""Save the results of a SLAM, or hold one against saved results until the verdict is sure."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from scripts.benchmark.runs_file import Results
from scripts.gate.runs import One, carried_out, name_of, of_results, results_of
from scripts.gate.told import Paired
from scripts.jobs import try_names
from scripts.machine import machine
from scripts.output import result_folder
from slam.errors import LogFormatError
from slam.files import write_text

COMMAND = "gate"
OTHERS = (
    "is of other scans than here: made by another version of mobilia, MuJoCo or NumPy, or on "
    "another kind of processor; --save it here again"
)
TOLD = ("summary.md", "junit.xml", "index.html")


def save(runs: Sequence[One], slam: str, seconds: float, out: Path, **ways: Any) -> Results:
    """The results of all runs. ``ways`` as ``scripts.workers.each`` has them."""
    name_of(slam)
    try_names((slam,), ())
    with result_folder(out, COMMAND, _settings(slam, runs)) as written:
        made = list(carried_out(runs, slam, out, **ways))
        with written():
            return results_of(slam, seconds, made)


def hold(path: Path, saved: Results, slam: str, out: Path, **ways: Any) -> Paired:
    """Run by run beside the results saved at ``path``, until it is sure; ``ways`` as of ``save``.

    Raises ``LogFormatError`` where they are of other scans than here.
    """
    runs = of_results(saved)
    paired = Paired(slam=slam, against=path.name, total=len(runs))
    try_names((slam,), ())
    with result_folder(out, COMMAND, _settings(slam, runs)) as written:
        for name in TOLD:  # of an earlier call: where this one fails there is no verdict
            (out / name).unlink(missing_ok=True)
        with closing(carried_out(runs, slam, out, **ways)) as made:
            for one, digest, now in made:
                scans, before = saved.runs[one.track][one.at]
                if digest != scans:
                    raise LogFormatError(path, f"{one} {OTHERS}")
                paired.add(one, before[saved.name], now)
                if paired.verdict != "undecided":
                    break
        with written() as staged:
            write_text(staged / "summary.md", paired.markdown())
            write_text(staged / "junit.xml", paired.junit())
    return paired


def _settings(slam: str, runs: Sequence[One]) -> dict[str, Any]:
    return {"slams": [slam], "runs": list(map(str, runs)), "machine": machine()}
