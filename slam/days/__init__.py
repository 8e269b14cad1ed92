# SPDX-License-Identifier: Apache-2.0
"""Maps that live with a building: sessions, habits of places, changes."""
