# SPDX-License-Identifier: Apache-2.0
"""What a tracker keeps of each scanner of a robot that has several, told apart by their mounts."""

from slam.frames import NS_PER_S, Frame
from slam.tracker.matching.matcher import Matcher, Usual

Mount = tuple[float, ...]  # ``LaserSpec.mount``


class Scanners:
    """When each of them looked last, and how its scans match.

    new  whether the latest frame is the first of one more scanner: what it sees may not be in the
         map yet
    """

    def __init__(self, matcher: Matcher) -> None:
        self._matcher = matcher
        self._usual: dict[Mount, Usual] = {}
        self._looked_ns: dict[Mount, int] = {}
        self.new = False

    def look(self, frame: Frame) -> float | None:
        """s since the scanner of this frame looked before; None where only one ever did.

        The matcher compares with scans of the same scanner from now on.
        """
        self.new = False
        if frame.scan is None:
            return None
        mount, before_ns = frame.scan.spec.mount, None
        if self._looked_ns:
            before_ns = self._looked_ns.get(mount)
            self.new = before_ns is None
        self._looked_ns[mount] = frame.stamp_ns
        if len(self._looked_ns) == 1:
            self._usual[mount] = self._matcher.usual
            return None
        numbers = self._matcher.config
        self._matcher.usual = self._usual.setdefault(mount, Usual(numbers.matching.usual))
        if before_ns is None:
            return numbers.map.first_look_s
        return (frame.stamp_ns - before_ns) / NS_PER_S
