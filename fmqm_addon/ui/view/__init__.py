# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a result stands in the 3D view."""
