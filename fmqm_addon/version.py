# SPDX-License-Identifier: GPL-3.0-or-later
"""The version of the add-on, as blender_manifest.toml has it."""

VERSION = "0.1.0"
