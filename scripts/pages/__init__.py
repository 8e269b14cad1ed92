# SPDX-License-Identifier: Apache-2.0
"""The page of a folder that a verb wrote, and the template of every page."""
