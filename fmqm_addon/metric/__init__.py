# SPDX-License-Identifier: GPL-3.0-or-later
"""FMQM, the field mesh quality metric, in plain numpy; knows nothing of Blender.

Source: K. Yang, Q. Yang, Z. Li, Y. Xu, "Textured mesh Quality Assessment using Geometry and Color
Field Similarity". Section and equation numbers in the docstrings of this package are that paper's.
docs/metric.md says what it leaves open and where the code leaves it.

Symbols: reference mesh M_r, distorted mesh M_d, sample p, its nearest surface point p_n, diagonal L of
a patch's bounding box. Lengths in here are in units of the reference's bounding box diagonal.
"""
