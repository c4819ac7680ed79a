# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar's panels. They show what is stored and compute nothing."""

from . import chain, compare, decimate, details, main, parts, results, settings, sizes, trust, view

# Panels before their sub-panels.
CLASSES: tuple[type, ...] = (
    *main.CLASSES,
    *settings.CLASSES,
    *results.CLASSES,
    *sizes.CLASSES,
    *details.CLASSES,
    *parts.CLASSES,
    *trust.CLASSES,
    *view.CLASSES,
    *compare.CLASSES,
    *decimate.CLASSES,
    *chain.CLASSES,
)
