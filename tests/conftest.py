# SPDX-License-Identifier: GPL-3.0-or-later
"""Lets every test import the checkout, installed or not."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
