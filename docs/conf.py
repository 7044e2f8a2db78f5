"""The documentation as a site: `make docs` builds it from the Markdown of this checkout.

The source folder is the whole checkout, so that links between pages work as they do on GitHub.
`reference.py` writes the pages under docs/reference/ from podusv's models.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

from podusv_cli import __version__  # noqa: E402

project = "podusv"
author = "podusv contributors"
version = release = __version__
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*", "docs/reference/*", "results/*.md", "examples/*/README.md"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4  # as GitHub forms them
default_role = "code"  # docstrings are in Markdown
highlight_language = "none"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
html_theme = "furo"
html_title = f"podusv {__version__}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False

START = '<meta http-equiv="refresh" content="0; url=docs/index.html">'
FOLDER_LINK = re.compile(r"\[([^]]+)\]\([\w./-]+/\)")


def setup(app: Sphinx) -> None:
    """Write the reference before pages are looked for; take out links that only a checkout has."""
    app.connect("config-inited", lambda app, config: write_reference())
    app.connect("source-read", without_folder_links)
    app.connect("build-finished", write_start)


def write_reference() -> None:
    """All pages that are made from podusv's models."""
    from reference import write

    write(ROOT / "docs" / "reference")


def without_folder_links(app: Sphinx, page: str, source: list[str]) -> None:
    """A link to a folder becomes its text: the site has pages and files only."""
    source[0] = FOLDER_LINK.sub(r"\1", source[0])


def write_start(app: Sphinx, error: Exception | None) -> None:
    """The page that a web server shows first."""
    Path(app.outdir, "index.html").write_text(START)
