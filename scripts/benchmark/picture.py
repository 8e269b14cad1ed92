# SPDX-License-Identifier: Apache-2.0
"""Two pictures of who is lost, on which track and from which level on: SVG for pages and the site.

They are as wide as a phone, bring their own ground, and follow the reader's light or dark.
"""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from scripts.report.answer import is_control

Row = dict[str, Any]
Lost = tuple[int, int]  # runs lost, and all
NAMES = ("lost_by_track.svg", "lost_by_level.svg")
WIDTH, PERCENT = 380, 100.0  # a phone's, px; all lengths below are of it
LEFT, STEP, ROW = 104, 34, 17  # where cells begin, their greatest width, their height
X, Y = (30, 246), (206, 26)  # of the curves: level 0 and 1, nothing and all lost
APART = 11  # between two names at the ends of their lines
LETTER = 5.3  # mean width
LONGEST = 19  # letters of a name
SHADES = (  # YlOrBr of ColorBrewer: darker is more, for every eye
    "#ffffe5", "#fff7bc", "#fee391", "#fec44f", "#fe9929", "#ec7014", "#cc4c02", "#993404",
    "#662506",
)  # fmt: skip
DARK = 6  # the first shade that takes white letters
_STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")


def drawn(
    lost: Mapping[str, Mapping[str, Lost]], ranked: Sequence[Row], subject: str, where: str
) -> dict[str, str]:
    """Both, by name of their file; the second only where SLAMs are ranked.

    lost   by the words over a column, then by SLAM
    where  what runs ``lost`` is of
    """
    named = [*(row["slam"] for row in ranked), *(slam for own in lost.values() for slam in own)]
    slams = list(dict.fromkeys(named))
    found = [by_track(lost, slams, subject, f"Runs lost by track, %: {where}")]
    if ranked:
        title = f"Runs lost by level, %: {ranked[0]['runs']} runs"
        found.append(by_level(ranked, subject, title))
    return dict(zip(NAMES, found, strict=False))


def by_track(
    lost: Mapping[str, Mapping[str, Lost]], slams: Sequence[str], subject: str, title: str
) -> str:
    """A row for each SLAM, a column for each track: the share of runs lost as a colour."""
    step = min(STEP, (WIDTH - LEFT - 4) / len(lost))
    top = 26 + LETTER * max(map(len, lost))
    parts = [
        f'<text transform="translate({LEFT + (k + 0.66) * step:.1f} {top - 5:.0f}) rotate(-90)">'
        f"{escape(track)}</text>"
        for k, track in enumerate(lost)
    ]
    for at, slam in enumerate(slams):
        y = top + at * ROW
        looks = "end mine" if slam == subject else "end mute" if is_control(slam) else "end"
        parts.append(_text(LEFT - 5, y + 12, _short(slam), looks))
        for k, of in enumerate(lost.values()):
            parts += _cell(LEFT + k * step, y, step - 1.0, of.get(slam))
        if slam == subject:
            wide = len(lost) * step + 2
            parts.append(
                f'<rect class="ring" x="{LEFT - 1.5}" y="{y - 0.5}" '
                f'width="{wide:.1f}" height="{ROW}" rx="3"/>'
            )
    return _svg(top + ROW * len(slams) + 8, title, parts)


def _cell(x: float, y: float, wide: float, of: Lost | None) -> list[str]:
    middle, line = x + wide / 2, y + 11.5
    if of is None:
        return [_text(middle, line, "–", "mid mute")]
    share = of[0] / of[1]
    shade = round(share * (len(SHADES) - 1))
    ground = f'x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{ROW - 1}" fill="{SHADES[shade]}"'
    ink = "mid on white" if shade >= DARK else "mid on"
    return [f"<rect {ground}/>", _text(middle, line, f"{PERCENT * share:.0f}", ink)]


def by_level(ranked: Sequence[Row], subject: str, title: str) -> str:
    """Of rows of ``scores.ranking`` the shares lost, each SLAM named at the end of its line."""
    levels = [float(level) for level in ranked[0]["levels"]]
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        parts.append(f'<path class="grid" d="M{X[0]} {_y(share):.1f}H{X[1]}"/>')
        parts.append(_text(X[0] - 4, _y(share) + 3, f"{PERCENT * share:.0f}", "end mute"))
    parts += [_text(_x(level), Y[0] + 14, f"{level:g}", "mid mute") for level in levels]
    parts.append(_text((X[0] + X[1]) / 2, Y[0] + 27, "level of a track", "mid mute"))
    ends = spread([_y(row["lost_shares"][-1]) for row in ranked], Y[0])
    rows = sorted(zip(ranked, ends, strict=True), key=lambda one: one[0]["slam"] == subject)
    for row, end in rows:  # the subject's last, above the others
        slam, shares = row["slam"], row["lost_shares"]
        mine, control = slam == subject, is_control(slam)
        line = "L".join(f"{_x(at):.1f} {_y(s):.1f}" for at, s in zip(levels, shares, strict=True))
        looks = "own" if mine else "control" if control else ""
        parts.append(f'<path class="{looks}" d="M{line}"/>')
        parts.append(f'<path class="grid" d="M{X[1]} {_y(shares[-1]):.1f}L{X[1] + 9} {end:.1f}"/>')
        words = f"{_short(slam)} {PERCENT * shares[-1]:.0f}"
        looks = "mine" if mine else "mute" if control else ""
        parts.append(_text(X[1] + 11, end + 3, words, looks))
    return _svg(Y[0] + 36, title, parts)


def spread(ends: Sequence[float], least: float) -> list[float]:
    """Heights for names near these: in their order, ``APART`` or more apart, at most ``least``."""
    order = np.argsort(np.asarray(ends), kind="stable").tolist()
    places = np.asarray(ends, dtype=np.float64)
    for above, k in pairwise(order):
        places[k] = max(places[k], places[above] + APART)
    for k in reversed(order):
        places[k] = min(places[k], least)
        least = float(places[k]) - APART
    return [float(place) for place in places]


def _x(level: float) -> float:
    return X[0] + level * (X[1] - X[0])


def _y(share: float) -> float:
    return Y[0] + share * (Y[1] - Y[0])


def _short(name: str) -> str:
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…"


def _text(x: float, y: float, words: str, looks: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{looks}">{escape(words)}</text>'


def _svg(height: float, title: str, parts: Sequence[str]) -> str:
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" '
    about = f'width="640" role="img" aria-label="{escape(title)}"><style>{_STYLE}</style>'
    ground = f'<rect class="back" width="{WIDTH}" height="{height:.0f}"/>'
    words = _text(4, 13, title, "head")
    return "\n".join([head + about, ground, words, *parts, "</svg>\n"])
