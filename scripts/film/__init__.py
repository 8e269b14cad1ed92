# SPDX-License-Identifier: Apache-2.0
"""Films, strips and recordings of runs."""

FPS = 30.0  # pictures per second of a film
