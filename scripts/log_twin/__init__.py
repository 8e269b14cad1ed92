# SPDX-License-Identifier: Apache-2.0
"""``mobilia twin``: a log driven again in its own building, and both laid side by side."""
