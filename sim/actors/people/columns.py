# SPDX-License-Identifier: Apache-2.0
"""The tables that all kernels of the crowd share, as records: ``state[i].speed``.

From Python a column is ``state["speed"]``. Here too are the values of the columns that stand for
words, imported as a module: ``task[i].walking == columns.FOLLOWS``.
"""

import numpy as np

from sim.core.state import record

# The people's state.
#   sit      0 stands to 1 sits; ``luck`` drawn for each trip: whether to look for a chair
#   ahead, left  m, one's place in the frame of whom one follows; ``spot`` m, where it is now
#   stays, slow  factors on stays and pace; ``turn_rate`` rad/s at most
#   free_at  s, who takes chairs along takes the next one then
#   dense    weight of other people: less in a crowd
#   file     m on the leader's way behind it, where one goes in file
# Who follows has no trips: ``arrive`` and ``luck`` are x, y m of the next place on the way.
STATE = record(
    np.float64,
    "speed stay_until blocked arrive look look_until vx vy best best_at walked_s blocked_s sit luck"
    " ahead left stays slow turn_rate free_at spot_x spot_y dense file",
)

# Their task: what one does, where to, disc row of one's chair (-1 none), row of one's leader (-1
# none), disc row of what one holds (-1 nothing), row of one's hold (-1), which chair of one's row
# is next, and the first place of one's line or row (-1).
TASK = record(np.int64, "walking goal seat leader held hand place first")
STANDS, WALKS, TO_SEAT, SEATED, FOLLOWS, QUEUES = range(6)  # values of ``walking``
TO_CHAIR, CLEANS, CARRIES = range(6, 9)

# A disc: everything with a round hull, people first; m and m/s.
DISC = record(np.float64, "x y r u v kind")
PERSON, THING, ROBOT, CHAIR, LEAF = 0.0, 1.0, 2.0, 3.0, 10.0  # LEAF + d: of the leaf of door d

# A door: centre, normal to the side it swings to, along the leaf when closed, width, angle (of one
# that slides: rad that open a hinge as far), whether it slides (not 0).
DOOR = record(np.float64, "cx cy nx ny ex ey width angle slides")

# The passage of a door: whose turn (side +1, -1, 0 none), asked for, someone in it.
PASSAGE = record(np.float64, "turn asked inside")

# A leader's course: heading rad of its formation, s it has stood, last crumb, number of crumbs.
COURSE = record(np.float64, "heading stood last count")

# A place in a line, m, and the number of places of that line; of a row of chairs also the disc row
# of the chair that stands there (-1 none) and its pose before.
PLACE = record(np.float64, "x y places chair home_x home_y home_yaw")
