# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's entry: Blender wants it beside blender_manifest.toml; everything is in fmqm_addon."""


def register() -> None:
    from . import fmqm_addon

    fmqm_addon.register()


def unregister() -> None:
    from . import fmqm_addon

    fmqm_addon.unregister()
