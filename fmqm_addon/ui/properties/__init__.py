# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on stores in the scene. Knows neither operators nor panels."""

from . import decimate, items, rows, scene, settings, sizes, view

# Groups before the group that holds them.
CLASSES: tuple[type, ...] = (
    *items.CLASSES,
    *rows.CLASSES,
    *settings.CLASSES,
    *view.CLASSES,
    *decimate.CLASSES,
    *sizes.CLASSES,
    *scene.CLASSES,
)
