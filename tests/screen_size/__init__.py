# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of fmqm_addon.comparison; none imports Blender."""
