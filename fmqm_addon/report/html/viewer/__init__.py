# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer of the report's page: pairs that can be turned around. Python writes their data, a script shows it."""
