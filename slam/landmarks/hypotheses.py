# SPDX-License-Identifier: Apache-2.0
"""Hypotheses of association: by which gates they are judged, what is found."""

from dataclasses import dataclass
from functools import lru_cache

from slam.arrays import Bools, Ints
from slam.settings import Settings, number

MOST_GATE = 1.0 - 1e-15
TUNED = "training seeds 0-19 (docs/paper/method.md)"


@lru_cache(maxsize=1024)
def chi_square(probability: float, degrees: int) -> float:
    """The value below which a chi-square variable lies with this probability."""
    from scipy.special import gammaincinv  # 0.3 s that other SLAMs need not pay

    return 2.0 * float(gammaincinv(degrees / 2.0, probability))


@dataclass(frozen=True, kw_only=True)
class Gates(Settings):
    """Gates of association, as probabilities of chi-square."""

    individual: float = number(
        0.999999,
        "prob",
        "chi-square probability of one pair under the prior, 2 dof",
        TUNED,
        low=0.5,
        high=MOST_GATE,
    )
    joint: float = number(
        0.999999,
        "prob",
        "chi-square probability of k pairs together, 2 k dof",
        TUNED,
        low=0.5,
        high=MOST_GATE,
    )
    posterior: float = number(
        0.99999,
        "prob",
        "chi-square probability of what one more pair adds, 2 dof",
        TUNED,
        low=0.5,
        high=MOST_GATE,
    )
    most_nodes: int = number(400, "hypotheses", "examined; then the best counts", low=1)

    def single(self) -> float:
        """Limit of a pair's cost under the prior."""
        return chi_square(self.individual, 2)

    def together(self, pairs: int) -> float:
        """Limit of the joint cost of so many pairs."""
        return chi_square(self.joint, 2 * pairs)

    def added(self) -> float:
        """Limit of what a pair adds to the joint cost."""
        return chi_square(self.posterior, 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Association:
    """``landmarks`` (k,) the landmark of each point or -1; ``cost`` the joint chi-square.

    plausible  (k,) bool: some landmark lies within the point's individual gate, taken or not
    """

    landmarks: Ints
    cost: float
    plausible: Bools

    @property
    def matched(self) -> int:
        """Number of pairs."""
        return int((self.landmarks >= 0).sum())
