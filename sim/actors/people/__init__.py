# SPDX-License-Identifier: Apache-2.0
"""People: plans, steps, right of way, sitting down."""
