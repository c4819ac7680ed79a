# SPDX-License-Identifier: GPL-3.0-or-later
"""Lets every test import the checkout, installed or not, and keeps Blender away from the user's own settings.

Hypothesis takes the same examples on every run, however long one takes: here, before any test is defined, since
@settings completes itself by the profile of that moment.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

# Read by Blender when bpy is imported, here and in the processes that tests start.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="fmqm-tests-")

settings.register_profile(
    "fmqm",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("fmqm")

_EXIT_STATUS = pytest.StashKey[int]()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    session.config.stash[_EXIT_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Ends the process here where bpy was loaded, since bpy 4.5 may wait forever at the end of Python.

    The add-on's own life is not hidden by it: tests/ui/test_addon.py starts processes that must end by themselves.
    What bpy 4.5 does without any of our code, and bpy 5.2 does not, is hang as long as something lives that was
    registered, which pytest may keep alive in a traceback or a cache:

        import bpy
        class Act(bpy.types.Operator):
            bl_idname, bl_label = "test.act", "Act"
            def execute(self, context):
                return {"FINISHED"}
        bpy.utils.register_class(Act)  # Python does not end, nor after this:

        import bpy
        def act(*_): pass
        bpy.app.handlers.save_pre.append(act)
    """
    shutil.rmtree(os.environ["BLENDER_USER_RESOURCES"], ignore_errors=True)
    if "bpy" in sys.modules and _EXIT_STATUS in config.stash:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash[_EXIT_STATUS])


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
