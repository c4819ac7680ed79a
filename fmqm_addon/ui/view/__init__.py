# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a result is shown in the 3D view."""
