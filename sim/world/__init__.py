# SPDX-License-Identifier: Apache-2.0
"""The room that moves: model, actors, physics in substeps, truth per beam."""
