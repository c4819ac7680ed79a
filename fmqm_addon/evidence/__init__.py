# SPDX-License-Identifier: GPL-3.0-or-later
"""How the numbers behave, for whoever doubts them: degrading, ladders and sweeps, judging against people's scores.

Outside the extension. May use scipy and matplotlib, which come as the extra `evidence`.
"""
