# SPDX-License-Identifier: Apache-2.0
"""One run into a folder: replay, scores, pictures."""
