# SPDX-License-Identifier: Apache-2.0
"""What is said of a robot's pose, scan by scan."""

from enum import StrEnum


class State(StrEnum):
    """What was done with a scan.

    TRACKING   the pose is believed, and the map was written
    OUTDATED   the same, and what stood here on earlier days is gone (``slam.days`` says so)
    FROZEN     the pose is the likeliest, but not believed: the map was not written
    LOST       it is not even that
    RELOCATED  the robot was found at another place in this scan
    BLIND      the scan has not one return
    """

    TRACKING = "tracking"
    OUTDATED = "map outdated here"
    FROZEN = "frozen"
    LOST = "lost"
    RELOCATED = "relocated"
    BLIND = "blind"
