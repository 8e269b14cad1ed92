# SPDX-License-Identifier: Apache-2.0
"""Who drives: tours, local avoidance, where a robot can go."""
