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
from mkdocs.structure.pages import Page
from pygments.formatters import HtmlFormatter

sys.path.append(str(Path(__file__).parent))
import search

_BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def with_formulas(text: str) -> str:
    """A page in Markdown with its formulas as MathML."""
    return _BLOCK.sub(lambda found: f'<div class="formula">{_mathml(found[1])}</div>', text)


def _mathml(latex: str) -> str:
    """Lines that end with two backslashes are lines of the formula; parts with wide space between break on a phone."""
    lines = [" ".join(line.split()) for line in latex.split(r"\\")]
    return "".join(f"<div>{' '.join(map(_part, _parts(line)))}</div>" for line in lines if line)


def _parts(line: str) -> list[str]:
    """What stands between wide spaces; the whole line where one is within braces."""
    parts = [part.strip() for part in line.split(r"\qquad")]
    whole = all(part and part.count("{") == part.count("}") for part in parts)
    return parts if whole else [line]


def _part(latex: str) -> str:
    return convert(latex, display="block")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by MkDocs for each page."""
    return with_formulas(markdown)


def with_links(html: str) -> str:
    """A page in HTML whose pictures link to their files, unless they are links, and are loaded when in sight."""
    linked = _PICTURE.sub(lambda found: found[1] or f'<a href="{found[3]}">{found[2]}</a>', html)
    return re.sub("<img (?!loading)", '<img loading="lazy" ', linked)


#: A picture within a link, or a picture and its file.
_PICTURE = re.compile(r'(<a [^>]*>\s*<img [^>]*>\s*</a>)|(<img [^>]*src="([^"]*)"[^>]*>)')


def with_signs(html: str) -> str:
    """A page in HTML whose formulas in sentences, such as y_3^2 or 2*10^5, have indices, exponents and signs."""
    parts, within = re.split(r"(<[^>]*>)", html), ""
    for i, part in enumerate(parts):
        tag = re.match(r"<(/?)(code|pre|math|script)\b", part)
        if tag and (not within or within == tag[2]):
            within = "" if tag[1] else tag[2]
        elif not within and not part.startswith("<"):
            for pattern, sign in _SIGNS:
                part = pattern.sub(sign, part)
            parts[i] = part
    return "".join(parts)


_SIGNS = [
    (re.compile(pattern), sign)
    for pattern, sign in (
        (r"(?<=\d)\*(?=10\^)", " \N{MULTIPLICATION SIGN} "),
        (r"(?<=[\d. ])\+- ?(?=[\d.])", "\N{PLUS-MINUS SIGN} "),
        (r"&lt;=", "\N{LESS-THAN OR EQUAL TO}"),
        (
            r"(?<![\w^])(d?[^\W\d_]\u0302?|omega|sigma|lambda|delta|xi|term|sum|grad)_(\w{1,4}|\{[^{}]*\})(?!\w)",
            r"\1<sub>\2</sub>",
        ),
        (r"(?<=[\w)|\]>])\^(-?\w+(?:\.\d+)?)", r"<sup>\1</sup>"),
        (r"(?<=[\w)|\]>])\^\(([^()]*)\)", r"<sup>\1</sup>"),
        (r"(?<=[\w)|\]>])\^\{([^{}]*)\}", r"<sup>\1</sup>"),
        (r"(<sup>)-", "\\1\N{MINUS SIGN}"),
        (r"(<su[bp]>)\{([^{}]*)\}", r"\1\2"),
    )
]


def on_page_content(html: str, page: Page, **_: Any) -> str:
    """Called by MkDocs for each page, when it is HTML."""
    html = with_links(html)
    return html if page.file.src_uri in _TYPED else with_signs(html)


#: Pages that show what a reader types, also outside of code.
_TYPED = {f"reference/{name}.md" for name in ("commands", "experiments", "python", "results", "spec")}


def on_post_build(config: MkDocsConfig) -> None:
    """Called by MkDocs behind its plugins, when the site is written."""
    search.write(Path(config.site_dir) / "search")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Called by MkDocs: the colours of code are a file of the site."""
    style = HtmlFormatter(style="friendly").get_style_defs(".codehilite")
    files.append(File.generated(config, "code.css", content=style))
    return files
