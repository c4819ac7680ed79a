# SPDX-License-Identifier: GPL-3.0-or-later
"""FMQM for Blender: does this LOD still look like the original?"""

from .version import VERSION

__all__ = ["VERSION", "register", "unregister"]


def register() -> None:
    """Shows the add-on in Blender. Imported here, so that scripts and tests of the metric load no panels."""
    from . import ui

    ui.register()


def unregister() -> None:
    """Leaves nothing behind."""
    from . import ui

    ui.unregister()
