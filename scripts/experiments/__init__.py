# SPDX-License-Identifier: Apache-2.0
"""Experiments, each ``python -m scripts.experiments.NAME``."""
