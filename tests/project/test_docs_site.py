"""The documentation as a site: its reference is that of the code, its links lead somewhere, it needs no network."""

import re
import subprocess
import sys

import pytest
from documents import PAGES, ROOT, page_name

sys.path.append(str(ROOT / "docs" / "generate"))
import gallery
import reference
from formulas import FORMULAS


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


def test_a_scheme_without_latex_has_its_formula_as_text():
    scheme = reference.SCHEMES["midpoint"]
    assert set(FORMULAS) <= set(reference.SCHEMES) and "\\frac" in reference._formula("midpoint", scheme)
    assert reference._formula("mine", scheme).startswith("```text\nz = y + h f((y+z)/2) + Σₖ σₖ dWₖ")


def test_site_builds_without_a_warning_and_needs_no_network(tmp_path):
    """Its formulas are MathML and its code is in colours, both made while it is built."""
    done = built(ROOT / "mkdocs.yml", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = [*tmp_path.rglob("*.html")]
    assert len(pages) > 20
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|iframe)[^>]* src="https?:', text), page
        assert not re.findall(r'<link[^>]* href="https?:', text), page
    texts = {page.name: page.read_text(encoding="utf-8") for page in pages}
    assert texts["schemes.html"].count("<math ") >= len(FORMULAS) and texts["weak_errors.html"].count("<math ") >= 2
    assert not [name for name, text in texts.items() if re.search(r"```math|\\(?:mathrm|frac|sigma|widehat)", text)]
    assert '<span class="' in texts["tutorial.html"] and (tmp_path / "code.css").is_file()
    for style in tmp_path.rglob("*.css"):
        assert not re.findall(r"url\(['\"]?https?:", style.read_text(encoding="utf-8")), style


def test_the_gallery_takes_what_results_there_are(tmp_path):
    (tmp_path / "toda_weak.h5").write_bytes(b"")
    assert gallery.found(tmp_path, "toda_weak", "laptop") == ("laptop", tmp_path / "toda_weak.h5")
    assert gallery.found(tmp_path, "toda_strong", "laptop") == ("quick", tmp_path / "toda_strong.quick.h5")
    text = ROOT.joinpath("docs", "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^`(\w+)` \(\w+\): ", text, re.MULTILINE)
    assert shown == re.findall(r"^\[!\[.*\]\(gallery/(\w+)\.png\)\]\(gallery/\1\.png\)$", text, re.MULTILINE)
    assert set(shown) <= set(reference.experiments_known()) and len(shown) > 50
