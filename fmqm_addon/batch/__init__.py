# SPDX-License-Identifier: GPL-3.0-or-later
"""Many pairs: named by manifests, kept in a journal, scored here, by watched workers or on a cluster.

Blender is imported only by what scores (run) or looks into files (sources.lod_rows), and there inside functions:
the parent of workers lives without it.
"""
