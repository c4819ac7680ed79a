# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file may promise at most: counted before Blender expands it, which nothing could stop then.

Far above what is worth measuring, and such that at each of them alone Blender comes back, within minutes.
"""

from __future__ import annotations

MAX_OBJECTS = 100_000  # that an importer makes: its time grows with their square (30,000 take 8 to 50 s)
MAX_INSTANCES = 1_000_000  # shown without being objects: by collections, by point instancers
MAX_PRIMS = 100_000  # of a USD stage, once references, payloads, inherits and variants are followed
MAX_DEPTH = 500  # of nodes, prims or groups in one another: importers call themselves at each
MAX_TRIANGLES = 200_000_000  # of all instances together; their arrays take 60 GB
MAX_KEYS = 20_000_000  # keyframes and morphed vertices
MAX_ZEROS = 2**30  # bytes of glTF accessors that have no data of their own
MAX_BYTES = 2**34  # of what is packed in a file, once unpacked
