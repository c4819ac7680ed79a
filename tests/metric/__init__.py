# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of fmqm_addon.metric; none needs Blender."""
