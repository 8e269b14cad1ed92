# SPDX-License-Identifier: Apache-2.0
"""How real is the simulated LMS-221? ``python -m scripts.experiments.real_scanner``.

Measures public logs of SICK scanners and simulated scans by the same code, fills the tables of
``docs/real_scanner.md`` and draws its picture.
"""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from scripts.card import beside
from scripts.card.beside import real_card, simulated_card
from scripts.console import ended
from scripts.marks import fill_page
from slam.evaluation.scanner.card import ScannerCard

ROOT = Path(__file__).resolve().parents[2]
PAGE, PICTURE = "docs/real_scanner.md", "docs/pictures/real_scanner.png"
LOGS_1_DEG = {
    "Wean Hall": ("wean_hall/robotdata1.log.xz", "wean_hall/robotdata2.log.xz"),
    "Intel": ("intel/intel-corrected.log.xz",),
    "FHW museum": ("fhw_museum/fhw-corrected.log.xz",),
}
LOGS_HALF_DEG = {"MIT CSAIL": ("mit_csail/csail-corrected.log.xz",)}
OURS_1_DEG = {
    "simulated, 1°": "lms221(resolution_deg=1)",
    "simulated, 1°, noise_m=0.0047": "lms221(resolution_deg=1, noise_m=0.0047)",
}
OURS_HALF_DEG = {"simulated, 0.5°": "lms221(resolution_deg=0.5)"}
Cards = dict[str, ScannerCard]


def real_cards(data: Path, logs: Mapping[str, tuple[str, ...]]) -> Cards:
    """One card a name."""
    return {name: real_card([data / path for path in paths]) for name, paths in logs.items()}


def our_cards(scanners: Mapping[str, str]) -> Cards:
    """One card a name."""
    return {name: simulated_card(scanner) for name, scanner in scanners.items()}


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Fill the page, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=os.environ.get("MOBILIA_DATA"),
                        help="folder of the logs; default MOBILIA_DATA")  # fmt: skip
    parser.add_argument("--root", type=Path, default=ROOT, help="folder of docs/")
    wanted = parser.parse_args(arguments)
    if wanted.data is None:
        parser.error("--data is missing, and MOBILIA_DATA is not set")
    one, half = real_cards(wanted.data, LOGS_1_DEG), real_cards(wanted.data, LOGS_HALF_DEG)
    ours_one, ours_half = our_cards(OURS_1_DEG), our_cards(OURS_HALF_DEG)
    page = wanted.root / PAGE
    fill_page(page, "one-degree", beside.markdown(one, ours_one))
    fill_page(page, "half-degree", beside.markdown(half, ours_half))
    beside.draw(wanted.root / PICTURE, {**one, **half}, {**ours_one, **ours_half})
    print(f"wrote {page} and {wanted.root / PICTURE}")


if __name__ == "__main__":
    sys.exit(main())
