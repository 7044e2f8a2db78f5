"""The documentation as a site: `make docs` builds it from the Markdown of this checkout.

The source folder is the whole checkout, so that links between pages work as they do on GitHub.
`reference.py` writes the pages under docs/reference/ from podusv's models.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

from podusv_cli import __version__  # noqa: E402

project = "podusv"
author = "podusv contributors"
version = release = __version__
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/*",
    "docs/laws/*",
    "docs/reference/*",
    "results/*.md",
    "examples/*/README.md",
]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4  # as GitHub forms them
myst_enable_extensions = ["dollarmath"]
html_math_renderer = "mathml"  # browsers draw it without a script from elsewhere
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
NAMESPACE = ' xmlns="http://www.w3.org/1998/Math/MathML"'  # HTML knows it
ALIGNED = re.compile(r"\\(?:begin|end)\{aligned\}")  # MathML's rows are aligned without it
FUNCTION = re.compile(r"<mi>(\w\w+)</mi>\s*<mo>&ApplyFunction;</mo>")
THIN = '<mspace width="0.17em"/>'  # beside a function's name, as LaTeX has it
BESIDE = {"munder": "msub", "munderover": "msubsup"}
ACCENTS = {"˙", "¨", "ˆ", "~", "¯"}
FOLDER_LINK = re.compile(r"\[([^]]+)\]\([\w./-]+/\)")


def setup(app: Sphinx) -> None:
    """Write the reference before pages are looked for; take out links that only a checkout has."""
    app.connect("config-inited", lambda app, config: write_reference())
    app.connect("source-read", without_folder_links)
    app.connect("build-finished", write_start)
    app.add_html_math_renderer("mathml", (write_inline, None), (write_block, None))


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


def mathml(latex: str, as_block: bool = False) -> str:
    """An equation as browsers draw it; bars and indices of accented letters as LaTeX has them."""
    drawn = tex2mathml(ALIGNED.sub("", latex).strip(), as_block=as_block)
    spaced = FUNCTION.sub(rf"{THIN}<mi>\1</mi>{THIN}", drawn).replace(NAMESPACE, "")
    root = ElementTree.fromstring(spaced)
    for part in root.iter():
        put_index_beside(part)
        if part.tag == "mo" and part.text == "|":
            part.attrib.update(lspace="0", rspace="0")
    return ElementTree.tostring(root, encoding="unicode")


def put_index_beside(part: ElementTree.Element) -> None:
    """The index of an accented letter, which docutils puts below it in a block."""
    if part.tag == "munderover" and part[2].text in ACCENTS:
        letter, index, accent = part
        part[:] = [ElementTree.Element("mover", accent="true"), index]
        part[0][:] = [letter, accent]
        part.tag = "msub"
    elif part.tag in BESIDE and part[0].get("accent"):
        part.tag = BESIDE[part.tag]


def write_inline(writer: SphinxTranslator, node: nodes.math) -> None:
    """An equation within a line, as MathML."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def write_block(writer: SphinxTranslator, node: nodes.math_block) -> None:
    """An equation of its own, as MathML; it scrolls where the window is narrow."""
    writer.body.append(f'<div class="equation">{mathml(node.astext(), as_block=True)}</div>')
    raise nodes.SkipNode
