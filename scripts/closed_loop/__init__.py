# SPDX-License-Identifier: Apache-2.0
"""``mobilia drive``: closed-loop runs, their tables and pictures."""
