# SPDX-License-Identifier: GPL-3.0-or-later
"""The names under which a record keeps a pair's pictures and its viewer's files; needs nothing that draws."""

from __future__ import annotations

import re
from collections.abc import Mapping

MESHES = ("reference", "distorted")
KINDS = (*MESHES, "heat")  # of the pictures of a view
LOSS, FRONT_VIEW = "loss", "front"  # views
VIEWER = "viewer"  # the folder beside the page
_DATA = re.compile(rf"{VIEWER}/[A-Za-z0-9-]+\.js")


def is_viewer(value: object) -> bool:
    """Whether a record's "viewer" is one: names that viewer.files.write_pair_data could have given."""
    return (
        isinstance(value, Mapping)
        and value.keys() == {"reference", "level"}
        and all(isinstance(path, str) and _DATA.fullmatch(path) for path in value.values())
    )
