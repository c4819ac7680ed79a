# SPDX-License-Identifier: GPL-3.0-or-later
"""What a single pair does not need is not imported for it: a start is a fifth of the whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
UNNEEDED = (
    "asyncio", "importlib.metadata", "xml.etree.ElementTree", "zipfile",
    "fmqm_addon.batch.cluster", "fmqm_addon.report.html.page", "fmqm_addon.report.render", "fmqm_addon.report.sheet",
    "fmqm_addon.report.html.pictures",
)  # fmt: skip


def test_the_scripts_import_only_what_a_pair_needs() -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import fmqm_addon.cli.score, fmqm_addon.cli.decimate;"
        "fmqm_addon.cli.score.blender_version(); import fmqm_addon.batch.scorer;"
        f"print([name for name in {UNNEEDED!r} if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
