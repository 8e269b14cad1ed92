# SPDX-License-Identifier: Apache-2.0
"""The site that ``make docs`` builds of docs/: what mkdocs calls while it builds, and its check.

Nothing here imports the rest of the project: the site's virtual environment has mkdocs alone.
"""
