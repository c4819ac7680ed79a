# SPDX-License-Identifier: GPL-3.0-or-later
"""`fmqm score` from a checkout, in Python or under the Blender program: see fmqm_addon/cli/score.py."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fmqm_addon.cli.process import run_script
from fmqm_addon.cli.score import main

if __name__ == "__main__":
    run_script(main, __file__)
