# SPDX-License-Identifier: GPL-3.0-or-later
"""`fmqm decimate` from a checkout, in Python or under the Blender program: see fmqm_addon/cli/decimate.py."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fmqm_addon.cli.decimate import main
from fmqm_addon.cli.process import run_script

if __name__ == "__main__":
    run_script(main, __file__)
