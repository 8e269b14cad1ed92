# SPDX-License-Identifier: Apache-2.0
"""Evidence weights of the belief, fitted, and whether what it believes is true.

``python -m scripts.integrity.fit --folder out/fit``.

Weights are fitted on labelled scans (``labelled``) of training tracks and of training streams of
the plane (``weights``), and stand beside those of the SLAM. Reliability is measured on streams of
the plane with other seeds (``reliability``). Recordings and labelled scans stay in ``--folder``;
those that other code has made are made anew. Writes ``docs/results/belief.json``, the two tables of
``docs/belief.md`` and ``docs/pictures/belief_reliability.png``. ``--no-test`` only fits.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from scripts import workers
from scripts.console import ended
from scripts.experiments.study import add_options, head, seeds_of
from scripts.integrity import reliability, weights
from scripts.integrity.campaign import logs_in
from scripts.integrity.labelled import Labelled
from scripts.integrity.reliability import Bin, Tested, curve, off_by
from scripts.integrity.sources import PLANES, TRACKS, collected, sources
from scripts.marks import fill_page, table
from scripts.options import whole
from scripts.result_files import write
from slam.errors import InvalidValueError, UnknownNameError
from slam.tracker.belief.config import BeliefConfig

PAGE, MARK, CURVE = Path("docs/belief.md"), "fit", "reliability"
PICTURE = Path("docs/pictures/belief_reliability.png")
FIRST_TEST_SEED = 50_000
GOING, CARRIED = (0.001, 0.01), (0.5, 0.95)  # quantiles of what goes on
UNITS = {row.path: row.about.unit for row in BeliefConfig().rows()}
Tables = dict[str, dict[str, Any]]


def fitted(many: Sequence[Labelled], resampled: int) -> Tables:
    """Value, interval, what the SLAM has and unit of each weight; quantiles of what goes on."""
    config = BeliefConfig()
    shares = (("going", GOING), ("carried", CARRIED))
    return {
        "weights": {
            name: {
                "fitted": value, "low": low, "high": high,
                "default": float(getattr(config, name)), "unit": UNITS[name],
            }
            for name, (value, low, high) in weights.fitted(many, config, resampled).items()
        },
        "goes on": {
            key: _quantiles([share for one in many for share in getattr(one, key)], at)
            for key, at in shares
        },
    }  # fmt: skip


def _quantiles(shares: Sequence[float], at: Sequence[float]) -> list[float]:
    """NaN of nothing."""
    return np.quantile(shares, at).tolist() if len(shares) else [math.nan] * len(at)


def markdown(many: Sequence[Labelled], tables: Tables) -> str:
    """The table of the fit, and on how much it rests."""
    cells = [
        [f"`belief.{name}`", f"{row['fitted']:.2f}", f"{row['low']:.2f} to {row['high']:.2f}",
         f"{row['default']:g}", row["unit"]]
        for name, row in tables["weights"].items()
    ]  # fmt: skip
    found, none, pairs, slips = (
        sum(len(getattr(one, key)) for one in many) for key in ("found", "none", "pairs", "slips")
    )
    going, carried = tables["goes on"]["going"], tables["goes on"]["carried"]
    return "\n\n".join(
        (
            f"{len(many)} streams; {found} scans searched in the map, {none} "
            f"of other buildings, {pairs} places true or beside the true one, "
            f"{slips} places nearby.",
            table(("setting", "fitted", "95 %", "in the SLAM", "unit"), cells),
            f"At right poses {100 * GOING[0]:g} % of the scans match less than {going[0]:.2f} of "
            f"the usual, and {100 * GOING[1]:g} % less than {going[1]:.2f}. Of the first scans "
            f"after a kidnap half match less than {carried[0]:.2f}, and {100 * CARRIED[1]:g} % "
            f"less than {carried[1]:.2f}.",
        )
    )


def tested(found: Sequence[Tested], curves: dict[str, list[Bin]]) -> Tables:
    """Each curve bin by bin, and how far each way to be lost is off."""
    out: Tables = {}
    for name, bins in curves.items():
        mean, most = off_by(bins)
        out[f"reliability of {name}"] = {one.name: asdict(one) for one in bins} | {
            "off by": {"mean": mean, "most": most}
        }
    ways = out["streams tested"] = {}
    for way in dict.fromkeys(one.way for one in found):
        own = [one.scans for one in found if one.way == way]
        bins = curve(own)
        ways[way] = {"streams": len(own), "scans": sum(len(s) for s in own), "off": off_by(bins)}
    return out


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("out/fit"), help="of what is kept")
    parser.add_argument("--streams", nargs="+", default=[*TRACKS, *PLANES], help="trained on")
    parser.add_argument("--logs", type=Path, nargs="+", default=[], help="logs, or folders of them")
    parser.add_argument("--resampled", type=int, default=weights.RESAMPLED, help="for intervals")
    parser.add_argument("--test-seeds", type=int, default=3, help="of every kind that is tested")
    parser.add_argument("--first-test-seed", type=int, default=FIRST_TEST_SEED)
    parser.add_argument("--no-test", action="store_true", help="only fit")
    parser.add_argument("--picture", type=Path, default=PICTURE)
    add_options(parser, "belief.json", PAGE)
    parser.set_defaults(seeds=3, first_seed=0, seconds=150.0)
    return parser


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables, write the results and the page."""
    wanted = _parser().parse_args(arguments)
    for name in wanted.streams:
        if name not in (*TRACKS, *PLANES):
            known = ", ".join((*TRACKS, *PLANES))
            raise UnknownNameError(f"--streams must be of {known}, got {name!r}")
    whole("--resampled", wanted.resampled, 1)
    whole("--test-seeds", wanted.test_seeds, 1)
    asked = ("streams", "resampled", "test_seeds", "first_test_seed")
    first = head(wanted, MARK, arguments, *asked, package="scripts.integrity")
    training = [*sources(wanted.streams, seeds_of(wanted)), *logs_in(wanted.logs)]
    if len(training) < 2:
        raise InvalidValueError(f"a fit needs two streams at least, got {len(training)}")
    many = collected(training, wanted.folder, wanted.jobs)
    tables = fitted(many, wanted.resampled)
    texts = {MARK: markdown(many, tables)}
    print(texts[MARK], flush=True)
    if not wanted.no_test:
        texts[CURVE] = _test(wanted, tables)
        print(texts[CURVE], flush=True)
    write(wanted.results, first, tables)
    for mark, filled in texts.items():
        if not wanted.no_page:
            fill_page(wanted.page, mark, filled)


def _test(wanted: argparse.Namespace, tables: Tables) -> str:
    """The text of the test; its numbers go into ``tables``, its picture is written."""
    seeds = range(wanted.first_test_seed, wanted.first_test_seed + wanted.test_seeds)
    asked = reliability.specs(reliability.TESTED, list(seeds), wanted.seconds)
    found = list(workers.each(reliability.tested, asked, jobs=wanted.jobs))
    found.sort(key=lambda one: (one.way, one.kind, one.seed))
    curves = {name: curve([getattr(one, name) for one in found]) for name in reliability.TITLES}
    tables |= tested(found, curves)
    reliability.picture(curves, wanted.picture)
    return reliability.markdown(curves)


if __name__ == "__main__":
    sys.exit(main())
