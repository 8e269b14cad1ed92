# SPDX-License-Identifier: Apache-2.0
"""Maps over the sessions of a building: runs, tables, pages."""
