# SPDX-License-Identifier: GPL-3.0-or-later
"""What all that is drawn over a 3D view needs: colors that are shown as they are, textures, shaders, the depth test.

`gpu` works only where there is a window, and while something is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import gpu
import numpy as np
from numpy.typing import NDArray

from ...metric.colorspace import encode_srgb

Array = NDArray[Any]

# Blender takes what is drawn over a view for linear light, and shows it by a power, whatever the screen. Not by the
# sRGB curve: dark colors would be up to 9/255 lighter.
VIEW_POWER = 2.2
TABLE_WIDTH = 4096  # of textures that hold a row of colors for each of many things


def for_view(encoded: Array) -> Array:
    """What a shader of ours writes so that a view shows just these encoded colors, in [0, 1]."""
    return np.power(encoded, VIEW_POWER)


def for_own_shaders(encoded: Array) -> Array:
    """The same for Blender's own shaders of plain colors, which take them for sRGB."""
    return encode_srgb(for_view(encoded))


def texture(values: Array, kind: str) -> Any:
    """A texture of (height, width, 4) values, the bottom row first; kind: its format, such as RGBA8."""
    height, width, _ = values.shape
    data = np.ascontiguousarray(values, np.float32)
    return gpu.types.GPUTexture((width, height), format=kind, data=gpu.types.Buffer("FLOAT", data.size, data.ravel()))


def table(values: Array, kind: str) -> Any:
    """A texture of (N, C) values, C at most 4, side by side in rows of TABLE_WIDTH."""
    rows = -(-len(values) // TABLE_WIDTH)
    padded = np.zeros((rows * TABLE_WIDTH, 4), np.float32)
    padded[: len(values), : values.shape[1]] = values
    return texture(padded.reshape(rows, TABLE_WIDTH, 4), kind)


def triangles(values: Mapping[str, Array], index: Array | None = None) -> Any:
    """A batch of triangles: (V, C) or (V,) values of their corners by name, and which three of these make one."""
    form = gpu.types.GPUVertFormat()
    for name, rows in values.items():
        form.attr_add(id=name, comp_type="F32", len=1 if rows.ndim == 1 else rows.shape[1], fetch_mode="FLOAT")
    buffer = gpu.types.GPUVertBuf(form, len(next(iter(values.values()))))
    for name, rows in values.items():
        buffer.attr_fill(name, np.ascontiguousarray(rows, np.float32))
    if index is None:
        return gpu.types.GPUBatch(type="TRIS", buf=buffer)
    corners = gpu.types.GPUIndexBuf(type="TRIS", seq=np.ascontiguousarray(index, np.int32))
    return gpu.types.GPUBatch(type="TRIS", buf=buffer, elem=corners)


def shader(
    vertex: str,
    fragment: str,
    constants: Mapping[str, str],
    sampler: str,
    inputs: Mapping[str, str],
    smooth: Mapping[str, str],
    flat: Mapping[str, str] | None = None,
    defines: Mapping[str, str] | None = None,
) -> Any:
    """A shader that writes `color`.

    Args:
        constants, inputs: types by name. sampler: name of its texture.
        smooth, flat: types by name of what goes from the one part to the other, between the corners or of the last.
    """
    info = gpu.types.GPUShaderCreateInfo()
    for name, kind in constants.items():
        info.push_constant(kind, name)
    info.sampler(0, "FLOAT_2D", sampler)
    for slot, (name, kind) in enumerate(inputs.items()):
        info.vertex_in(slot, kind, name)
    between = gpu.types.GPUStageInterfaceInfo(f"fmqm_{'_'.join(inputs)}")
    for name, kind in smooth.items():
        between.smooth(kind, name)
    for name, kind in (flat or {}).items():
        between.flat(kind, name)
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "color")
    for name, value in (defines or {}).items():
        info.define(name, value)
    info.vertex_source(vertex)
    info.fragment_source(fragment)
    return gpu.shader.create_from_info(info)


@contextmanager
def depth_tested() -> Iterator[None]:
    """What is drawn meanwhile hides what is behind it, and is hidden by what is before it."""
    depth, mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    try:
        yield
    finally:
        gpu.state.depth_mask_set(mask)
        gpu.state.depth_test_set(depth)
