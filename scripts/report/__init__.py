# SPDX-License-Identifier: Apache-2.0
"""``mobilia report``: a comparison as one page that opens from disk, prints and asks nobody."""
