# SPDX-License-Identifier: Apache-2.0
"""On which track a SLAM gets lost, and at which level (``docs/benchmark.md``)."""
