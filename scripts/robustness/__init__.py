# SPDX-License-Identifier: Apache-2.0
"""What damage, kills, power cuts, full disks and odd calls do."""
