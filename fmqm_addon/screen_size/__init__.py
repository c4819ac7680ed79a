# SPDX-License-Identifier: GPL-3.0-or-later
"""At which size on screen an LOD may replace its reference: both rendered with numpy, and their images compared."""
