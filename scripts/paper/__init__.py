# SPDX-License-Identifier: Apache-2.0
"""``mobilia reproduce``: the paper's experiments, its figures and its tables with ours beside."""

EXPERIMENTS = ("victoria-park", "landmarks", "chairs", "office", "theory")
"""What ``reproduce`` makes, by name."""
