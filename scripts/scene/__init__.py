# SPDX-License-Identifier: Apache-2.0
"""``mobilia scene``: scenes made from maps and logs, shown and checked."""
