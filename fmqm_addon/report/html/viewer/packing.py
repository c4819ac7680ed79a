# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays as short text for scripts: 16 bits a number, differences from row to row, deflated."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....metric.geometry import Floats

STEPS = 65535  # of a quantized number


def quantized(values: Floats, low: Floats, span: Floats) -> NDArray[np.uint16]:
    """(N, K) steps from low to low + span, each to the nearest; the inverse of restored().

    Args:
        values: (N, K). low, span: (K,); a span of 0 holds one value.
    """
    share = (values - low) / np.where(span > 0, span, 1)
    return np.rint(np.clip(share, 0, 1) * STEPS).astype(np.uint16)


def restored(steps: NDArray[np.uint16], low: Floats, span: Floats) -> Floats:
    """(N, K) values as the viewer reads them."""
    values: Floats = low + steps / STEPS * span
    return values


def ends(values: Floats) -> tuple[Floats, Floats]:
    """(K,) lowest values and spans of (N, K); zeros for no rows."""
    if not len(values):
        return np.zeros(values.shape[1]), np.zeros(values.shape[1])
    low = values.min(axis=0)
    return low, values.max(axis=0) - low


def packed(rows: NDArray[np.unsignedinteger[Any]]) -> str:
    """(N, K) unsigned numbers as base64 of deflated bytes: column after column, each row less the one before."""
    steps = np.diff(rows, axis=0, prepend=np.zeros((1, rows.shape[1]), rows.dtype))  # wraps around
    return base64.b64encode(zlib.compress(steps.T.astype(steps.dtype.newbyteorder("<")).tobytes(), 6)).decode()


def unpacked(text: str, columns: int, dtype: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    """The (N, K) rows of packed(), as the viewer reads them."""
    steps = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.dtype(dtype).newbyteorder("<"))
    return np.cumsum(steps.reshape(columns, -1), axis=1, dtype=dtype).T


def script_text(name: str, plain: Mapping[str, Any]) -> str:
    """A classic script that hands plain values to the viewer; no text in it can end it or begin another.

    Args:
        name: of its file, below the page.
    """
    return f"fmqmViewer.take({_literal(name)}, {_literal(plain)});\n"


def _literal(value: Any) -> str:
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)  # ASCII: no U+2028 either
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
