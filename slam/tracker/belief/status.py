# SPDX-License-Identifier: Apache-2.0
"""What is said of a robot's pose, scan by scan."""

from enum import StrEnum


class State(StrEnum):
    """What was done with a scan.

    TRACKING   the pose is believed, and the map was written
    FROZEN     the pose is the likeliest, but not believed: the map was not written
    LOST       another place is likelier
    RELOCATED  the robot was found at another place in this scan
    BLIND      the scan has not one return
    """

    TRACKING = "tracking"
    FROZEN = "frozen"
    LOST = "lost"
    RELOCATED = "relocated"
    BLIND = "blind"


class Status(StrEnum):
    """What may be wrong: nothing, the map in view, the pose, or there is nothing to see."""

    TRACKING = "tracking"
    OUTDATED = "map outdated here"
    LOST = "lost"
    BLIND = "blind"
