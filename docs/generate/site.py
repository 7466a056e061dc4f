"""What MkDocs does with the pages beyond Markdown: formulas become MathML, blocks of code get colours, pictures link to
themselves in full size, and the search works without a server.

A formula stands in a block of the language `math`, in LaTeX, as GitHub shows it too.  Browsers draw MathML themselves,
so that nothing is loaded when a page is read.
"""

import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from pygments.formatters import HtmlFormatter

sys.path.append(str(Path(__file__).parent))
import search

_BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def with_formulas(text: str) -> str:
    """A page in Markdown with its formulas as MathML."""
    return _BLOCK.sub(lambda found: f'<div class="formula">{_mathml(found[1])}</div>', text)


def _mathml(latex: str) -> str:
    """Lines that end with two backslashes are lines of the formula, each on its own."""
    lines = [" ".join(line.split()) for line in latex.split(r"\\")]
    return "".join(convert(line, display="block") for line in lines if line)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by MkDocs for each page."""
    return with_formulas(markdown)


def with_links(html: str) -> str:
    """A page in HTML whose pictures link to their files, unless they are links, and are loaded when in sight."""
    linked = _PICTURE.sub(lambda found: found[1] or f'<a href="{found[3]}">{found[2]}</a>', html)
    return re.sub("<img (?!loading)", '<img loading="lazy" ', linked)


#: A picture within a link, or a picture and its file.
_PICTURE = re.compile(r'(<a [^>]*>\s*<img [^>]*>\s*</a>)|(<img [^>]*src="([^"]*)"[^>]*>)')


def on_page_content(html: str, **_: Any) -> str:
    """Called by MkDocs for each page, when it is HTML."""
    return with_links(html)


def on_post_build(config: MkDocsConfig) -> None:
    """Called by MkDocs behind its plugins, when the site is written."""
    search.write(Path(config.site_dir) / "search")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Called by MkDocs: the colours of code are a file of the site."""
    style = HtmlFormatter(style="friendly").get_style_defs(".codehilite")
    files.append(File.generated(config, "code.css", content=style))
    return files
