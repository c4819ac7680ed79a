# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of docs/evidence.md, as PNG: the same results give the same bytes. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..report.atomic_files import replaced
from .consistency import READINGS, Results, beside, kept_ranking
from .distortions import GTC, WEBP

_DPI = 80
_STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
}


def write_plots(folder: Path, results: Results) -> dict[str, str]:
    """Writes all that the results suffice for, and removes the others; lines of Markdown that show them, by block."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = {}
    with plt.rc_context(_STYLE):
        for block, text, draw in (
            ("order", "Both numbers by kind and level", _ladders),
            ("settings", "Rank correlation by setting", _settings),
            ("beside", "FMQM and perceived of every pair", _beside),
        ):
            name, figure = f"evidence_{block}.png", draw(plt, results)
            if figure is None:
                (folder / name).unlink(missing_ok=True)
                continue
            with replaced(str(folder / name)) as path:
                figure.savefig(path, dpi=_DPI, metadata={"Software": None})
            plt.close(figure)
            shown[block] = f"![{text}]({name})"
    return shown


def _ladders(plt: Any, results: Results) -> Any:
    """A column of two panels for each kind: a line for each model, from mild to harsh."""
    kinds = results.kinds
    figure, axes = plt.subplots(
        2,
        len(kinds),
        figsize=(1.75 * len(kinds) + 1, 5),
        sharey=True,
        sharex="col",
        squeeze=False,
        layout="constrained",
    )
    for column, kind in enumerate(kinds):
        levels = [each for each in results.of_kind(kind) if each.codec != WEBP]
        for row, reading in enumerate(READINGS):
            for model in results.models:
                values = [results.over_seeds(model, each, reading) for each in levels]
                means = [np.mean(each) if each else np.nan for each in values]
                line = "none" if kind == GTC else "-"  # its levels are no chain
                places = [each.level for each in levels]
                axes[row, column].plot(places, means, linestyle=line, marker=".", label=model)
        axes[0, column].set_title(kind)
        axes[1, column].set_xlabel("level")
    for row, reading in enumerate(READINGS):
        axes[row, 0].set_ylabel(reading)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
    return figure


def _beside(plt: Any, results: Results) -> Any:
    figure, axis = plt.subplots(figsize=(6, 4.5), layout="constrained")
    for kind in results.kinds:
        axis.scatter(*beside(results, kind), s=12, label=kind)
    axis.set_xlabel("FMQM")
    axis.set_ylabel("perceived")
    axis.legend(loc="lower right", frameon=False)
    return figure


def _settings(plt: Any, results: Results) -> Any:
    """A dot for each setting and reading; None where no sweep was measured."""
    swept = results.study.swept
    found = {each.name: [kept_ranking(results, each, reading)[0] for reading in READINGS] for each in swept}
    found = {name: values for name, values in found.items() if None not in values}
    if not found:
        return None
    figure, axis = plt.subplots(figsize=(6, 0.24 * len(found) + 1.2), layout="constrained")
    for index, reading in enumerate(READINGS):
        axis.plot([values[index] for values in found.values()], list(found), "o", markersize=5, label=reading)
    axis.invert_yaxis()
    axis.set_xlabel("rank correlation with the fast preset")
    axis.legend(loc="lower left", frameon=False)
    return figure
