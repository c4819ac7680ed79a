# SPDX-License-Identifier: GPL-3.0-or-later
"""A result as something to keep or to look at; knows the metric, not Blender."""
