# SPDX-License-Identifier: GPL-3.0-or-later
"""The page that people look at: every pair's score, pictures and warnings in one HTML file with pictures beside it.

It needs no network and no server. Names come from strangers' files: every text goes through html.escape.
"""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from ..atomic_files import write_parts
from ..explain import footnote
from ..numbers import value_text
from .first_screen import chains, common_facts, look_first, masthead, toolbar
from .fragments import text
from .overview import overview_of
from .pair_card import pair_card
from .table import table
from .viewer.files import write_programs
from .viewer.markup import viewer_script, viewer_style

PAGE = "index.html"
# Only what lies beside the page is loaded; only its own script runs, and what that loads, whatever a name might hold.
POLICY = """default-src 'none'; base-uri 'none'; form-action 'none'; img-src 'self' file: data:;
style-src 'unsafe-inline'; script-src 'sha256-{}' 'strict-dynamic'"""
_STYLES = ("page.css", "card.css")
_SCRIPTS = ("page.js", "pictures.js")
_LIGHTBOX = """<dialog class="lightbox" aria-label="Picture"><figure><figcaption></figcaption></figure>
<button type="button" class="before" aria-label="Picture before">‹</button>
<button type="button" class="after" aria-label="Next picture">›</button>
<button type="button" class="close" aria-label="Close">×</button></dialog>"""

Record = Mapping[str, Any]


def write_page(
    folder: str, records: Iterable[Record], settings: Mapping[str, Any], versions: Mapping[str, str]
) -> None:
    """Writes index.html into the folder of a report.

    Args:
        records: the pairs as JSON has them, in their order; gone through more than once. Besides the scores each
            may hold "trust", "explanation", "attribution", and "pictures", which is what
            write_pair_pictures returned.
        settings, versions: as JSON has them.

    Raises:
        FileError: it cannot be written; what stood there is left as it was.
    """
    if any(record.get("viewer") for record in records):
        write_programs(folder)
    write_parts(os.path.join(folder, PAGE), page_parts(records, settings, versions))


def page_parts(records: Iterable[Record], settings: Mapping[str, Any], versions: Mapping[str, str]) -> Iterator[str]:
    """The text of the page; the arguments are those of write_page."""
    # All that stands between the tags, as the digest wants.
    script = "".join(map(_beside, _SCRIPTS)) + viewer_script()
    policy = POLICY.format(base64.b64encode(hashlib.sha256(script.encode()).digest()).decode())
    overview = overview_of(records)
    yield f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<link rel="icon" href="data:,">
<title>FMQM report</title>
<style>
{"".join(map(_beside, _STYLES))}{viewer_style()}</style>
<noscript><style>.pair, .table {{ display: block; }} .toolbar {{ display: none; }}</style></noscript>
</head>
<body>
{masthead(overview)}<main>
{look_first(overview)}{common_facts(overview)}{toolbar(overview)}"""
    yield from chains(overview)
    yield from table(records, overview)
    yield '<p class="more" hidden><button type="button">Show More</button></p>'
    yield '<p class="nothing note" hidden>No pair is like that.</p>\n<div class="pairs">\n'
    for number, record in enumerate(records, 1):
        yield pair_card(number, record, overview)
    yield f"""</div>
{_settings(settings, versions)}<p class="note">{escape(footnote(records))}</p>
</main>
{_LIGHTBOX}
<script>{script}</script>
</body>
</html>
"""


def _beside(name: str) -> str:
    """The text of a file beside this one."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "<br>".join(f"{text(name)}: {text(value_text(part))}" for name, part in value.items()) or "none"
    return text(value_text(value))


def _settings(settings: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    shown = {**settings, "scored_patches": settings.get("scored_patches") or "all"}
    rows = "".join(f"<div><dt>{_words(name)}</dt><dd>{_value(value)}</dd></div>" for name, value in shown.items())
    made = ", ".join(f"{_words(name)} {text(value)}" for name, value in versions.items())
    return (
        f'<section><h2>Settings</h2><dl class="card settings">{rows}</dl><p class="note">{made}. Texture MB: '
        "the images that colors are read from, uncompressed, four bytes a pixel.</p></section>"
    )


def _words(name: str) -> str:
    return escape(name.replace("_", " "))
