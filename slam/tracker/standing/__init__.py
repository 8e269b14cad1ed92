# SPDX-License-Identifier: Apache-2.0
"""For how long what a return comes from has stood: which returns count for the motion."""
