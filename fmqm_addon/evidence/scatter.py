# SPDX-License-Identifier: GPL-3.0-or-later
"""A metric's numbers against people's, as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..report.atomic_files import replaced
from .agreement import Agreement

Array = NDArray[np.float64]


def draw_scatter(path: str, name: str, x: Array, opinions: Array, kinds: Sequence[str], found: Agreement) -> None:
    """Writes a PNG: a dot a pair, a color a kind of distortion, and the fitted curve.

    Args:
        x, opinions: (n,). kinds: (n,) names, or empty.
        found: of these numbers; has a curve.
    """
    figure = Figure(figsize=(6, 4.5), dpi=160, layout="constrained")
    axes = figure.add_subplot()
    names = list(dict.fromkeys(kinds))
    colors = [mpl.colormaps["tab10"](index) for index in range(10)]
    groups = np.array([names.index(kind) for kind in kinds]) if names else np.zeros(len(x), int)
    for index in range(max(len(names), 1)):
        chosen = groups == index
        label = names[index] if len(names) > 1 else None
        axes.scatter(x[chosen], opinions[chosen], s=12, alpha=0.7, linewidths=0, color=colors[index % 10], label=label)
    if found.curve is not None:
        line = np.linspace(np.nanmin(x), np.nanmax(x), 200)
        axes.plot(line, found.curve(line), color="black", linewidth=1.2)
    told = ", ".join(f"{key} {found.values[key]:.3f}" for key in ("PLCC", "SROCC", "RMSE") if key in found.values)
    axes.set(xlabel=name, ylabel="mean opinion score", title=f"{found.rows} pairs: {told}")
    axes.spines[["top", "right"]].set_visible(False)
    if len(names) > 1:
        axes.legend(frameon=False, fontsize="small", ncols=2)
    with replaced(path) as temporary:
        figure.savefig(temporary, metadata={"Software": None})
