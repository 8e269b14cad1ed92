# SPDX-License-Identifier: Apache-2.0
"""What stands in which column of the tables that all kernels of the crowd share.

Imported as a module: ``state[i, columns.SPEED]``.
"""

from __future__ import annotations

# The people's state, (n, 24) float64.
SPEED, STAY_UNTIL, BLOCKED, ARRIVE, LOOK, LOOK_UNTIL = range(6)
VX, VY, BEST, BEST_AT, WALKED_S, BLOCKED_S = range(6, 12)
SIT, LUCK = 12, 13  # 0 stands to 1 sits; drawn for each trip: whether to look for a chair
AHEAD, LEFT = 14, 15  # m, one's place in the frame of whom one follows
STAYS, SLOW, TURN_RATE = 16, 17, 18  # factors on stays and pace; rad/s at most
FREE_AT = 19  # s, who takes chairs along takes the next one then
SPOT_X, SPOT_Y = 20, 21  # m, where that place is now
DENSE = 22  # weight of other people: less in a crowd
FILE = 23  # m on the leader's way behind it, where one goes in file
N_STATE = 24
AIM_X, AIM_Y = ARRIVE, LUCK  # m; of one who follows and has no trips: the next place on the way

# Their task, (n, 8) int64: what one does, where to, disc row of one's chair (-1 none), row of one's
# leader (-1 none), disc row of what one holds (-1 nothing), row of one's hold (-1), which chair of
# one's row is next, and the first place of one's line or row (-1).
WALKING, GOAL, SEAT, LEADER, HELD, HAND, PLACE, FIRST = range(8)
N_TASK = 8
STANDS, WALKS, TO_SEAT, SEATED, FOLLOWS, QUEUES = range(6)  # values of WALKING
TO_CHAIR, CLEANS, CARRIES = range(6, 9)

# A disc, (k, 6) float64: everything with a round hull, people first.
X, Y, R, U, V, KIND = range(6)
PERSON, THING, ROBOT, CHAIR, LEAF = 0.0, 1.0, 2.0, 3.0, 10.0  # LEAF + d: of the leaf of door d

# A door, (m, 9) float64: centre, normal to the side it swings to, along the leaf when closed,
# width, angle (of one that slides: rad that open a hinge as far), whether it slides (not 0).
CX, CY, NX, NY, EX, EY, WIDTH, ANGLE, SLIDES = range(9)
N_DOOR = 9

# Its passage, (m, 3): whose turn (side +1, -1, 0 none), asked for, someone in it.
TURN, ASKED, INSIDE = range(3)
