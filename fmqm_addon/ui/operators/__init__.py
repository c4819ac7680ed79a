# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar's buttons."""

from . import (
    chain,
    decimate,
    flip,
    inputs,
    live,
    loupe,
    measure,
    pick,
    presets,
    probe,
    report,
    results,
    save,
    screen_sizes,
    view,
)

CLASSES: tuple[type, ...] = (
    *inputs.CLASSES,
    *measure.CLASSES,
    *live.CLASSES,
    *presets.CLASSES,
    *results.CLASSES,
    *save.CLASSES,
    *report.CLASSES,
    *view.CLASSES,
    *pick.CLASSES,
    *probe.CLASSES,
    *loupe.CLASSES,
    *flip.CLASSES,
    *decimate.CLASSES,
    *chain.CLASSES,
    *screen_sizes.CLASSES,
)
