# SPDX-License-Identifier: Apache-2.0
"""Where the robot may be: one posterior over a few places, and all that is decided by it."""
