# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m fmqm_addon` is the command `fmqm`."""

from .cli.command import main

main()
