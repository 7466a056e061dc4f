"""The documentation as a site: its reference is that of the code, its links lead somewhere, it needs no network."""

import re
import runpy
import subprocess
import sys

import pytest
from documents import PAGES, ROOT, page_name

sys.path.append(str(ROOT / "docs" / "generate"))
import reference
from formulas import FORMULAS

#: The hooks of MkDocs, in a file that has the name of a module of Python.
with_links = runpy.run_path(str(ROOT / "docs" / "generate" / "site.py"))["with_links"]


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_targets_and_files_exist(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", ROOT.joinpath("Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    targets += [path.stem for path in ROOT.joinpath("experiments").glob("*.yaml")]
    for target in re.findall(r"(?:`|^)make ([a-z_-]+)", text, re.MULTILINE):
        assert target in targets
    for path in re.findall(
        r"\b(?:benchmarks|tests|experiments|spi)/[\w/]+\.(?:py|yaml)\b", text.replace("NAME.yaml", "")
    ):
        assert ROOT.joinpath(path).is_file(), path


@pytest.mark.parametrize("page", PAGES[:2], ids=lambda page: page.name)
def test_links_lead_to_files(page):
    """Those of the pages in docs are checked by MkDocs."""
    links = re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8"))
    assert links
    for link in links:
        assert ROOT.joinpath(link).is_file(), link


@pytest.fixture(scope="module")
def pages():
    return reference.pages()


def test_reference_is_that_of_the_code(pages):
    assert sorted(pages) == sorted(reference.FOLDER.glob("*.md"))
    for path, text in pages.items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name} is not that of the code; say `make docs`"


def test_reference_says_what_every_key_is(pages):
    """A description for each key, and for each model, scheme and command its place."""
    pages = {path.stem: text for path, text in pages.items()}
    for name in ("spec", "models", "commands"):
        assert not re.findall(r"^\|.*\| *\|$", pages[name], re.MULTILINE)
    assert "| `final_time` | number >\N{NO-BREAK SPACE}0 | time | **required** |" in pages["spec"]
    assert "| `seed` | whole number ≥\N{NO-BREAK SPACE}0 |  | `1` |" in pages["spec"]
    for name, known in (("models", reference.MODELS), ("schemes", reference.SCHEMES), ("spec", reference.KINDS)):
        for entry in known:
            assert f"\n## {entry}\n" in pages[name]


def built(config, target):
    program = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", config, "--site-dir", target]
    return subprocess.run(program, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, as MkDocs builds it without a warning."""
    folder = tmp_path_factory.mktemp("site")
    done = built(ROOT / "mkdocs.yml", folder)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_site_needs_no_network(site):
    """Its formulas are MathML and its code is in colours, both made while it is built."""
    pages = [*site.rglob("*.html")]
    assert len(pages) > 20
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|iframe)[^>]* src="https?:', text), page
        assert not re.findall(r'<link[^>]* href="https?:', text), page
    texts = {page.name: page.read_text(encoding="utf-8") for page in pages}
    assert texts["schemes.html"].count("<math ") >= len(FORMULAS) and texts["weak_errors.html"].count("<math ") >= 2
    for name in ("answer", "lyapunov", "extrapolation", "own_systems", "fluids", "concepts"):
        assert texts[f"{name}.html"].count("<math ") >= 2, name
    assert not [name for name, text in texts.items() if re.search(r"```math|\\(?:mathrm|frac|sigma|widehat)", text)]
    assert '<span class="' in texts["tutorial.html"] and (site / "code.css").is_file()
    for style in site.rglob("*.css"):
        assert not re.findall(r"url\(['\"]?https?:", style.read_text(encoding="utf-8")), style


def test_pictures_open_in_full_size_and_links_lead_somewhere(site):
    pages = {page.resolve(): page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    pages.pop(site.resolve() / "404.html")  # which a server shows in any folder, so that its links begin at the root
    for page, text in pages.items():
        assert unlinked(text.partition('role="main"')[2]) == [], page
        assert dead_links(page, text, pages) == [], page
    assert sum(text.count("<img ") for text in pages.values()) > 100


def unlinked(html):
    """The pictures that are no link to their own file."""
    linked = re.findall(r'<a href="([^"]*)">\s*<img [^>]*src="\1"', html)
    return [file for file in re.findall(r'<img [^>]*src="([^"]*)"', html) if file not in linked]


def dead_links(page, html, pages):
    """The links from a page of the site to files or places that there are not."""
    dead = []
    for link in re.findall(r'(?:href|src)="([^"]*)"', html):
        path, _, place = link.partition("#")
        if re.match("[a-z]+:", link) or link in ("", "#"):
            continue
        target = (page.parent / path.partition("?")[0]).resolve() if path else page
        if not target.exists() or (place and f'id="{place}"' not in pages.get(target, "")):
            dead.append(link)
    return dead
