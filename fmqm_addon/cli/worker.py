# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts `fmqm score` by this file's path, as workers are started, in Python and under the Blender program.

By its path, not as a module: a module would be looked for in the working directory, where files of strangers may lie,
and another installed FMQM would answer to the same name.
"""

import importlib.util
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]

if PACKAGE.name not in sys.modules:
    spec = importlib.util.spec_from_file_location(
        PACKAGE.name, PACKAGE / "__init__.py", submodule_search_locations=[str(PACKAGE)]
    )
    assert spec and spec.loader
    sys.modules[PACKAGE.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[PACKAGE.name])

from fmqm_addon.cli.process import run_script
from fmqm_addon.cli.score import main

if __name__ == "__main__":
    run_script(main, __file__)
