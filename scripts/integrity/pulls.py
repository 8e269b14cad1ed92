# SPDX-License-Identifier: Apache-2.0
"""By how much movers pull a robot off, and by how much the SLAM says: ``Pull``'s numbers.

    python -m scripts.integrity.pulls --jobs 2

Streams of the plane. All corrections of a stream are kept, with the old surface that was in view,
and by what the pose erred more. Then ``Agreement`` goes through them again with other numbers. Both
errors and what is said of them are summed over its window, and what each window forgets, squared,
is added up: the variance by which the map is off in the end. The last row is the same of errors
less what is said of them, over all ways.
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from scripts import workers
from scripts.console import ended
from scripts.integrity.plane import frames
from scripts.integrity.ways import Case
from scripts.marks import fill_page, table
from scripts.options import whole
from slam import se2
from slam.frames import Float
from slam.frontend.odometry_prior import Prediction
from slam.shunting import ShuntingSlam
from slam.tracker.standing.agreement import Agreement, Pull
from slam.tracker.standing.config import StandingConfig

WAYS = ("boards", "chairs", "corridor", "crowd", "herd", "outdated", "poor", "rates")
FIRST_SEED, SECONDS = 300_000, 150.0
PAGE = Path("docs/trust_in_returns.md")
NEAR_M = 0.3  # farther off a robot is lost, whatever pulls it
NUMBERS = StandingConfig()
PULLS = {
    "as it is": Pull(),
    "holds 0.3": Pull(holds=0.3),
    "holds 3": Pull(holds=3.0),
    "few 0.2": Pull(few=0.2),
    "few 0.01": Pull(few=0.01),
}
Event = tuple[Callable[..., object], tuple[object, ...], Float | None]
"""What ``Agreement`` was told, and for a match by what (3,) the pose erred more, map frame."""


class _Recorder(Agreement):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Callable[..., object], tuple[object, ...]]] = []
        super().__init__(NUMBERS)

    def forget(self) -> None:
        self.told.append((Agreement.forget, ()))
        super().forget()

    def hold(self, old: Float, elapsed_s: float) -> None:
        self.told.append((Agreement.hold, (old.copy(), elapsed_s)))
        super().hold(old, elapsed_s)

    def turned(self, by: float) -> None:
        self.told.append((Agreement.turned, (by,)))
        super().turned(by)

    def take(
        self, prediction: Prediction, T_map_robot: Float, vote: float, in_doubt: bool = False
    ) -> None:
        self.told.append((Agreement.take, (prediction, T_map_robot.copy(), vote, in_doubt)))
        super().take(prediction, T_map_robot, vote, in_doubt)

    def undragged(self, T_map_robot: Float, dragged: float) -> Float:
        kept = list(self.told)
        pose = super().undragged(T_map_robot, dragged)
        self.told = [*kept, (Agreement.undragged, (T_map_robot.copy(), dragged))]
        return pose


def recorded(case: Case) -> list[Event]:
    """One stream, through ``shunting``."""
    stream, slam, agreement = frames(case.spec), ShuntingSlam(), _Recorder()
    slam._standing.agreement = slam._belief._agreement = agreement
    events: list[Event] = []
    before = T_map_before = np.zeros(3)
    for frame in stream:
        estimate = slam.update(frame.without_truth())
        T_map_before = T_map_before + estimate.diagnostics["correction"]  # the map was moved
        assert stream[0].truth is not None
        assert frame.truth is not None
        truth, pose = se2.between(stream[0].truth, frame.truth), slam._T_map_robot
        c, s = math.cos(float(T_map_before[2])), math.sin(float(T_map_before[2]))
        x, y, turn = (se2.between(T_map_before, pose) - se2.between(before, truth)).tolist()
        erred = np.array([c * x - s * y, s * x + c * y, se2.wrap(turn)])
        events += [(what, told, erred) for what, told in agreement.told]
        if math.hypot(*(pose - truth)[:2].tolist()) > NEAR_M:
            events.append((Agreement.forget, (), None))
        agreement.told, before, T_map_before = [], truth, pose.copy()
    return events


def variances(events: Sequence[Event], pull: Pull) -> Float:
    """(3,) m^2 of positions: of errors, of what is said, and of errors without what is said."""
    agreement, out, error = Agreement(NUMBERS, pull), np.zeros(3), np.zeros(3)
    latest = np.zeros(3)
    for what, told, erred in events:
        what(agreement, *told)
        if what in (Agreement.forget, Agreement.undragged):  # that scan's match was not used
            error, latest = np.zeros(3), np.zeros(3)
        elif what is Agreement.take and erred is not None:
            out += latest
            keep = math.exp(-told[0].elapsed / NUMBERS.window_s)  # type: ignore[attr-defined]
            error = keep * error + erred
            said = agreement.by_movers
            both = (error, said, error - said)
            latest = np.array([float(v[0] ** 2 + v[1] ** 2) for v in both]) * (1.0 - keep * keep)
    return out + latest


def _asked(asked: tuple[str, int]) -> tuple[str, Float]:
    """A way, and the variances of its how-manieth stream by ``PULLS``."""
    way, number = asked
    case = Case(way=way, number=number, slam="", first_seed=FIRST_SEED, seconds=SECONDS)
    events = recorded(case)
    return way, np.array([variances(events, pull) for pull in PULLS.values()])


@ended
def main() -> None:
    """Print a row for each way, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--each", type=int, default=8, help="streams of each way")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--page", type=Path, default=PAGE)
    wanted = parser.parse_args()
    whole("--each", wanted.each, 1)
    whole("--jobs", wanted.jobs, 1)
    sums = {way: np.zeros((len(PULLS), 3)) for way in WAYS}
    asked = [(way, number) for number in range(wanted.each) for way in WAYS]
    for way, found in workers.each(_asked, asked, jobs=wanted.jobs):
        sums[way] += found
    each = 1e4 / (wanted.each * SECONDS / 60.0)
    rows = []
    for way, of in sums.items():
        rows.append([way, f"{each * of[0, 0]:.0f}", *(f"{each * said:.0f}" for said in of[:, 1])])
    true, _, left = np.sum(list(sums.values()), axis=0).T
    rows.append(["not said, of all", "1", *(f"{share:.2f}" for share in left / true)])
    text = table(["cm² in a minute", "true", *PULLS], rows)
    print(text)
    fill_page(wanted.page, "pulls", text, most=100)


if __name__ == "__main__":
    sys.exit(main())
