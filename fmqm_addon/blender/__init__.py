# SPDX-License-Identifier: GPL-3.0-or-later
"""bpy and mathutils to arrays, and back."""
