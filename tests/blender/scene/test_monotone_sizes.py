# SPDX-License-Identifier: GPL-3.0-or-later
"""That renders of an LOD differ more the larger they are, on real models: a switch size means nothing otherwise."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.files.load import load_asset, open_file
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.decimate import read_version
from fmqm_addon.comparison.decimation import Version
from fmqm_addon.screen_size.definition import FADE, STRICT
from fmqm_addon.screen_size.measure import ScreenSizes

VERSIONS = (Version(ratio=0.25), Version(ratio=0.06), Version(texture=64), Version(texture=128))


@pytest.mark.parametrize("model", ["egyptian_cat", "low_poly_tree"])
def test_d_grows_with_the_size_and_coarser_levels_last_no_longer(shared_data: Path, model: str) -> None:
    """Up to the first size that fails, the last that anything depends on; docs/screen-size.md has the share."""
    path, reading = str(shared_data / f"objpng/{model}/{model}.obj"), Reading(normals=True)
    sizes = ScreenSizes(load_asset(path, reading).world())
    sizes.prepare().run()
    open_file(path, reading)
    names = [each.name_full for each in bpy.data.objects if each.type == "MESH"]
    found = [sizes.measure(read_version(names, "lod", each, reading).world()).run() for each in VERSIONS]
    for each, limits in ((each, limits) for each in found for limits in (STRICT, FADE)):
        steps = list(pairwise(at.difference(limits) for at in each.curve))
        assert all(before <= after for before, after in steps if before <= 1)
    quarter, sixteenth, least, half = (each.strict.pixels for each in found)
    assert quarter >= sixteenth and half >= least
