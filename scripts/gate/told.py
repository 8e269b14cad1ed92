# SPDX-License-Identifier: Apache-2.0
"""What a gate says: a sentence, a table, Markdown for a pull request, JUnit's XML for a CI."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean
from xml.etree import ElementTree

from scripts.benchmark.runs_file import Row
from scripts.gate.evidence import ERRORS, LEAST, WORSE, WRONG, Verdict, change, verdict
from scripts.gate.runs import One
from scripts.pages.table import NONE, Cell, Table

SURE = f"wrong in at most {100.0 * WRONG:.0f} of 100 cases"
HEAD = ("track", "runs", "lost", "aligned ATE, cm", "RPE, cm/s", "error")
Pair = tuple[One, Row, Row]  # a run, its row before, and now


@dataclass(kw_only=True, eq=False)
class Paired:
    """A SLAM beside saved results, run by run.

    slam, against  its name, and that of the file
    total          runs that there are at most
    pairs, changes  of each run so far its rows, and ``scripts.gate.evidence.change``
    """

    slam: str
    against: str
    total: int
    pairs: list[Pair] = field(default_factory=list)
    changes: list[float | None] = field(default_factory=list)

    def add(self, one: One, before: Row, now: Row) -> None:
        """One more run."""
        self.pairs.append((one, before, now))
        self.changes.append(change(before, now))

    @property
    def verdict(self) -> Verdict:
        """What is sure by now."""
        return verdict(self.changes)

    def said(self) -> list[str]:
        """The verdict, what it rests on, and the first failure."""
        lost, held = (self.changes.count(end) for end in (math.inf, -math.inf))
        ratio = _times(self.changes)
        facts = f"{lost} newly lost, {held} newly held, {len(self.pairs)} of {self.total} runs"
        fifth = f"{100.0 * WORSE:.0f} %"
        first, more = {
            "worse": ("is worse than", f"Such a verdict is {SURE}."),
            "not worse": (
                "is not worse than",
                f"{fifth} more error, or as many runs newly lost, is excluded ({SURE}).",
            ),
            "undecided": (
                "is undecided against",
                f"Neither that it is worse nor that it is not by {fifth} is sure: save more "
                "--tracks or --seeds, or another --level.",
            ),
        }[self.verdict]
        failed = [str(now["failure"]) for _, _, now in self.pairs if now["failure"]]
        said = f"`{self.slam}` {first} {self.against}: error {ratio}, {facts}."
        return [said, more, *failed[:1]]

    def worst(self) -> One | None:
        """The run that got worse most; None where none did."""
        told = zip((value or 0.0 for value in self.changes), self.pairs, strict=True)
        value, pair = max(told, key=lambda one: one[0], default=(0.0, None))
        return pair[0] if pair is not None and value > 0.0 else None

    def table(self) -> Table:
        """A row for each track."""
        tracks = dict.fromkeys(one.track for one, _, _ in self.pairs)
        rows = [self._row(track) for track in tracks]
        return Table(caption=f"now [{self.against}]", head=HEAD, rows=rows)

    def markdown(self) -> str:
        """For a comment or the summary of a job."""
        head, *more = self.said()
        parts = [f"### {head}", *more, f"Now, in brackets {self.against}:", self.table().markdown()]
        worst = self.worst()
        if worst is not None:
            parts.append(f"The run that got worse most:\n\n    {worst.blame(self.slam)}")
        return "\n\n".join(parts) + "\n"

    def junit(self) -> str:
        """One test case: the verdict is on all runs together. Undecided is skipped."""
        kind = {"worse": "failure", "undecided": "skipped"}.get(self.verdict)
        counts = {"tests": "1", "failures": str(int(kind == "failure")), "errors": "0",
                  "skipped": str(int(kind == "skipped"))}  # fmt: skip
        suite = ElementTree.Element("testsuite", {"name": "mobilia gate", **counts})
        about = {"classname": "mobilia.gate", "name": f"{self.slam} against {self.against}"}
        case = ElementTree.SubElement(suite, "testcase", about)
        if kind is not None:
            ElementTree.SubElement(case, kind, {"message": " ".join(self.said())})
        ElementTree.SubElement(case, "system-out").text = self.markdown()
        ElementTree.indent(suite)
        return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"

    def _row(self, track: str) -> list[Cell]:
        own = [(before, now) for one, before, now in self.pairs if one.track == track]
        held = [pair for pair in own if not any(row["lost"] for row in pair)]
        both = [[str(sum(pair[k]["lost"] for pair in own)) for k in (0, 1)]]
        both += [[_middle([pair[k] for pair in held], key) for k in (0, 1)] for key in ERRORS]
        cells = [Cell(text=now, small=before) for before, now in both]
        times = _times([change(*pair) for pair in own])
        return [Cell(text=track), Cell(text=str(len(own))), *cells, Cell(text=times)]


def _middle(rows: Sequence[Row], key: str) -> str:
    """Geometric mean of an error, in cm."""
    logs = [math.log(max(row[key], LEAST)) for row in rows if row[key] is not None]
    return f"{100.0 * math.exp(mean(logs)):.2f}" if logs else NONE


def _times(changes: Sequence[float | None]) -> str:
    held = [value for value in changes if value is not None and math.isfinite(value)]
    return f"× {math.exp(mean(held)):.2f}" if held else NONE
