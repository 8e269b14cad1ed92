# SPDX-License-Identifier: Apache-2.0
"""The live view: a running world or a log as a page in a browser."""

SLOWEST, FASTEST = 0.05, 20.0  # of the view, as a factor of real time
