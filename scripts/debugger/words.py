# SPDX-License-Identifier: Apache-2.0
"""The verdict in words, as a table and as JSON."""

import math
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from scripts.debugger.counterfactual import CURED, Inquest, Trial
from slam.frames import NS_PER_S

FIXED = (
    "the commands to the robot, the draws of scanner and odometry, everybody's schedule and draws"
)


def time_s(found: Inquest, row: int) -> float:
    """Of a row of the tape, since its first."""
    frames = found.tape.strip.frames
    return (frames[row].stamp_ns - frames[0].stamp_ns) / NS_PER_S


def headline(found: Inquest) -> tuple[str, str]:
    """The verdict, and what it rests on."""
    verdict, question = found.verdict, found.question
    if found.moment is None:
        rule = question.rule
        return (
            "No divergence",
            f"The error never rises by {rule.threshold_m:g} m within {rule.within_s:g} s and "
            f"stays; the largest rise is {found.largest_rise_m:.2f} m, the last error "
            f"{found.end_error_m:.2f} m"
            + (", gathered slowly." if found.end_error_m > rule.threshold_m else "."),
        )
    at = f"at {time_s(found, found.moment.found):.1f} s"
    up = f"The error rises by {found.rise_m:.2f} m {at}"
    if verdict == "weak":
        return f"Nothing to explain {at}", f"{up}: less than a re-run could be told by."
    sure = f"{up}; with other noise again in {found.recurs} of {question.repeats}."
    if verdict in ("culprit", "several"):
        return _named(found) + ("" if found.firm else ", weakly"), sure + _cured(found)
    if verdict == "undecided":
        never, no_cure = "with other noise it does not happen", "no cure works with other noise"
        return f"Undecided: {never if found.rare else no_cure}", sure + _tries(found)
    if verdict == "joint":
        singles = any(trial.kind == "single" for trial in found.trials)
        alone = "nobody alone, but " if singles else ""
        return f"Joint: {alone}{who(found.named[0])} cures it", sure + _cured(found)
    why = "sensor, geometry or odometry"
    return f"Not the movers: {why}", sure + " It also happens with all movers out and all frozen."


def _named(found: Inquest) -> str:
    """Who, and whether it was the motion or the presence."""
    names = [(*t.change.out, *t.change.frozen)[0] for t in found.named]
    if len(names) > 1:
        return f"Several: without any one of {', '.join(names)} it does not happen"
    best = found.named[0]
    still = any(t.cured and t.change.frozen == (names[0],) for t in found.trials)
    motion = "its motion" if still else "its presence"
    return f"Culprit: {names[0]}, {motion} ({100.0 * min(best.share, 1.0):.0f} % of the error gone)"


def _cured(found: Inquest) -> str:
    return f" Cured in {found.named[0].again} of {found.question.repeats}."


def _tries(found: Inquest) -> str:
    tries = (found.cures or found.together)[:3]
    of = found.question.repeats
    return "".join(f" Cured by {who(t)}: {t.again} of {of}." for t in tries)


def who(trial: Trial) -> str:
    """What was changed."""
    if trial.kind == "all":
        return f"all movers {'out' if trial.change.out else 'frozen'}"
    return str(trial.change)


def table(found: Inquest) -> Table:
    """One row for each re-run, the best first."""
    shown = Table(title=escape(headline(found)[0]), title_justify="left")
    shown.add_column("changed")
    for heading in ("beams", "moved, m", "error, m", "removed", "others, m"):
        shown.add_column(heading, justify="right")
    shown.add_column("verdict")
    seen = {s.name: s for s in found.suspects}
    shown.add_row("nothing", "", "", f"{found.rise_m:.2f}", "", "", "as it was")
    order = {"all": 0, "group": 1, "single": 2, "pair": 3}
    for trial in sorted(
        found.trials, key=lambda t: (order[t.kind], math.inf if math.isnan(t.share) else -t.share)
    ):
        names = trial.change.out or trial.change.frozen
        sighting = seen.get(names[0]) if trial.kind == "single" else None
        seen_as = (str(sighting.beams), f"{sighting.moved_m:.2f}") if sighting else ("", "")
        told = f"{trial.rise_m:.2f}", f"{100.0 * trial.share:.0f} %", f"{trial.others_m:.2f}"
        cells = ("failed", "", "") if trial.failed else told
        shown.add_row(escape(who(trial)), *seen_as, *cells, _word(found, trial))
    return shown


def _word(found: Inquest, trial: Trial) -> str:
    if trial.kind == "all":
        return "control: cured" if trial.cured else "control"
    if not trial.cured:
        return ""
    return f"cured, again {trial.again} of {found.question.repeats}"


def as_json(found: Inquest) -> dict[str, Any]:
    """Everything but the scans."""
    case, question = found.tape.case, found.question
    words: dict[str, Any] = {
        "schema": 1,
        "slam": case.slam,
        "verdict": found.verdict,
        "says": list(headline(found)),
        "rule": asdict(question.rule),
        "cured_below": CURED,
        "largest_rise_m": found.largest_rise_m,
        "end_error_m": found.end_error_m,
    }
    if found.moment is None:
        return words
    words |= {
        "firm": found.firm,
        "held_fixed": FIXED,
        "slam_at_checkpoint": found.how,
        "checkpoint_s": time_s(found, found.first),
        "begins_s": time_s(found, found.moment.begins),
        "found_s": time_s(found, found.moment.found),
        "horizon_s": time_s(found, found.last),
        "rise_m": found.rise_m,
        "recurs_with_other_noise": [found.recurs, question.repeats],
        "suspects": [asdict(s) for s in found.suspects],
        "trials": [_trial(found, t) for t in found.trials],
    }
    return words


def _trial(found: Inquest, trial: Trial) -> dict[str, Any]:
    numbers = ("rise_m", "share", "path_m", "others_m")
    words: dict[str, Any] = {
        "out": list(trial.change.out),
        "frozen": list(trial.change.frozen),
        **({"called": trial.change.called} if trial.change.called else {}),
        "kind": trial.kind,
        "cured": trial.cured,
        **{n: None if trial.failed else getattr(trial, n) for n in numbers},
    }
    if trial.cured:
        words["again_with_other_noise"] = [trial.again, found.question.repeats]
    if trial.failed:
        words["failed"] = trial.failed
    else:
        words["errors_m"] = [round(e, 5) for e in trial.strip.errors_m(found.then)]
    return words
