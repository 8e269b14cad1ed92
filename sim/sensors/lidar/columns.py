# SPDX-License-Identifier: Apache-2.0
"""What stands in which column of the tables that all kernels of a scanner share.

Imported as a module: ``fan[i, col.AZIMUTH]``.
"""

# A geom, (n, 7): mjtGeom, size, half its height, whether it is a box that stands upright for good;
# the layer, 0 for the room, 1 for panes that a beam may pass.
KIND, SIZE_X, SIZE_Y, SIZE_Z, HALF_HEIGHT, UPRIGHT, LAYER = range(7)
PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6  # values of KIND
PRIMITIVES = (PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX)

# A pose, (slots, n, 12) and in tuples: position, then matrix by rows.
PX, PY, PZ, R00, R01, R02, R10, R11, R12, R20, R21, R22 = range(12)
N_POSE = 12

# The geoms of one body, (bodies, 4): its id, their first row and the row after their last; and
# whether it rests where its bounds are of, was placed anew before the scan, or moves in it.
RUN_BODY, RUN_FIRST, RUN_END, RUN_STATE = range(4)
RESTS, PLACED, MOVES = range(3)  # values of RUN_STATE

# Where the laser was, (slots, 3).
LASER_X, LASER_Y, LASER_YAW = range(3)

# A beam as planned, (m, 5): angle in the laser frame, its cosine and sine, the slot of the last
# noted poses before the beam, and which part of the way to the next slot it comes at.
ANGLE, ANGLE_COS, ANGLE_SIN, PLAN_SLOT, PLAN_PART = range(5)

# A beam laid in the world, (m, 7): azimuth, origin, direction, slot and part as above.
AZIMUTH, ORIGIN_X, ORIGIN_Y, COS, SIN, SLOT, PART = range(7)
N_BEAM = 7

# A fan, (fans, 4): first and last azimuth, beams per radian, and the largest departure of an
# azimuth from even steps.
START, STOP, PER_RADIAN, UNEVEN = range(4)
N_FAN = 4

# The bounds of a geom, (n, 6): a disc that contains it during the whole scan, its height above the
# ground and half its vertical extent; and whether the geom moved.
DISC_X, DISC_Y, DISC_RADIUS, DISC_Z, DISC_HALF, MOVED = range(6)
N_BOUND = 6

# A window, (3 n, 4): nearest and farthest distance at which the geom can be met, and the interval
# of azimuth, without the width of a spot.
NEAR, FAR, LOW, HIGH = range(4)
N_WINDOW = 4

# A ray of a spot in the beam's frame, (k, 6): place on the disc (left, up), unit direction
# (forward, left, up), and the way up per metre forward.
U, V, FORWARD, LEFT, UP, RISE = range(6)
N_RAY = 6

# What the receiver makes of a scan: (3, n) distance m, that of the middle ray, |cos|; (2, n) bool.
PLACE, MIDDLE, COSINE = range(3)
MIXED, GHOST = range(2)
GEOM_ID, BODY_ID = range(2)  # whose a value is, (2, n)

# A band of the statistical error, (k, 3): up to m, deviation m, deviation per metre.
UP_TO, SIGMA, SIGMA_PER_M = range(3)
