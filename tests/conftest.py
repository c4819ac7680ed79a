# SPDX-License-Identifier: GPL-3.0-or-later
"""Lets every test import the checkout, installed or not, and keeps Blender away from the user's own settings."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

# Read by Blender when bpy is imported, here and in the processes that tests start.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="fmqm-tests-")


@pytest.hookimpl(trylast=True)
def pytest_unconfigure() -> None:
    shutil.rmtree(os.environ["BLENDER_USER_RESOURCES"], ignore_errors=True)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real models that lies beside the checkout, where there is one."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no folder ../shared/data with real models beside the checkout")
    return folder


@pytest.fixture(scope="session")
def blender() -> str:
    """Path of the Blender program."""
    program = os.environ.get("FMQM_BLENDER")
    if not program:
        pytest.skip("FMQM_BLENDER does not name a Blender program")
    return program
