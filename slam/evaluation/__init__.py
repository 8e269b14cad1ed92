# SPDX-License-Identifier: Apache-2.0
"""What a score is: metrics, when a run is lost, divergence, statistics."""
