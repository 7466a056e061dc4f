"""The documentation as a site: its reference is that of the code, its links lead somewhere, it needs no network."""

import json
import re
import runpy
import shutil
import subprocess
import sys
from collections import Counter

import pytest
from documents import PAGES, ROOT, page_name

sys.path.append(str(ROOT / "docs" / "generate"))
import reference
import search
from formulas import FORMULAS

#: The hooks of MkDocs, in a file that has the name of a module of Python.
HOOKS = runpy.run_path(str(ROOT / "docs" / "generate" / "site.py"))
with_links, with_signs, mathml = HOOKS["with_links"], HOOKS["with_signs"], HOOKS["_mathml"]


@pytest.mark.needs
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


@pytest.mark.needs
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
    texts = {page.relative_to(site).as_posix(): page.read_text(encoding="utf-8") for page in pages}
    assert texts["reference/schemes.html"].count("<math ") >= len(FORMULAS)
    for name in ("weak_errors", "answer", "lyapunov", "extrapolation", "own_systems", "fluids", "concepts"):
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


def test_a_picture_without_a_link_and_a_dead_link_are_noticed(tmp_path):
    page = tmp_path / "a.html"
    page.write_text("")
    html = '<h2 id="x"></h2><img alt="" src="a.png"><a href="b.png">\n<img src="b.png"></a>'
    html += '<a href="#x"> <a href="#y"> <a href="c.html">'
    assert unlinked(html) == ["a.png"]
    assert dead_links(page, html, {page: html}) == ["a.png", "b.png", "b.png", "#y", "c.html"]
    assert with_links('<img src="a.png">') == '<a href="a.png"><img loading="lazy" src="a.png"></a>'
    assert unlinked(with_links(html)) == [] and with_links(with_links(html)) == with_links(html)


#: What a newcomer asks: the words to search for, and the page that is the first hit.
QUESTIONS = {
    "install": "install",
    "own system": "own_systems",
    "simulate one path": "trajectories",
    "choose a scheme": "choose",
    "how many samples": "answer",
    "resume": "long_runs",
    "Slurm": "long_runs",
    "figure for a journal": "figures",
    "CSV": "report",
    "first passage": "statistics",
    "what is a Casimir": "concepts",
    "cite": "cite",
    **{
        "GPU": "install",
        "Ito": "concepts",
        "own scheme": "own_schemes",
        "license": "cite",
        "weak errors": "weak_errors",
        "extrapolation": "extrapolation",
    },
}

#: Words that several pages have: the page is one of the first two.
ALSO = {
    "restart": "long_runs",
    "antiferromagnet": "lattices",
    "passive tracer": "fluids",
    "OVF": "spins",
    "hysteresis": "spins",
    "collapse": "finite_size",
    "critical exponent": "finite_size",
}


def hits(index, query):
    """The hits of a query, best first, by the rule of search.js."""
    scores, found = Counter(), Counter()
    asked = [word for word in search.words(query) if word not in index["ignored"]]
    for word in asked:
        terms = [word] if word in index["weights"] else [term for term in index["weights"] if term.startswith(word)]
        best = {}
        for i, weight in (pair for term in terms for pair in index["weights"][term]):
            best[i] = max(weight, best.get(i, 0.0))
        scores.update(best)
        found.update(best.keys())
    ranked = sorted(scores, key=lambda i: -scores[i] * found[i] / len(asked))
    return [index["entries"][i][0] for i in ranked]


def clicks(site, page):
    """The pages that the text of a page, neither its menu nor its footer, links to."""
    text = site.joinpath(page).read_text(encoding="utf-8").partition('role="main"')[2].partition("<footer>")[0]
    return {link.partition("#")[0] for link in re.findall(r'<a href="([\w/]+\.html[^"]*)"', text)}


def test_questions_of_a_newcomer_are_answered(site):
    """Every page is within two clicks from the home page, and an answer is the first hit of the search."""
    index = json.loads(site.joinpath("search", "index.js").read_text("utf-8").partition("= ")[2].rstrip(";\n"))
    assert all(index["weights"][word] for word in search.SYNONYMS)
    first = clicks(site, "index.html")
    near = first.union(*(clicks(site, page) for page in first if "/" not in page))
    pages = {page.relative_to(site).as_posix() for page in site.rglob("*.html")}
    assert pages - near <= {"404.html", "index.html", "search.html"}, "docs/index.md needs a link"
    for query, page in QUESTIONS.items():
        assert hits(index, query)[0].partition("#")[0] == f"{page}.html", (query, hits(index, query)[:3])
    for query, page in ALSO.items():
        found = [*dict.fromkeys(hit.partition("#")[0] for hit in hits(index, query))]
        assert f"{page}.html" in found[:2], (query, found[:3])


@pytest.mark.skipif(not shutil.which("node"), reason="nothing that runs JavaScript")
def test_the_page_of_the_search_ranks_alike(site):
    """And it reads its index as a script, which works from a folder."""
    files = [site / "search" / name for name in ("main.js", "index.js")]
    code = "const fs = require('fs');"
    code += "".join(f"eval.call(null, fs.readFileSync({json.dumps(str(file))}, 'utf8'));" for file in files)
    code += f"for (const query of {json.dumps([*QUESTIONS])})"
    code += "  console.log(JSON.stringify(searchHits(search_index, query).map(hit => hit[0])));"
    done = subprocess.run(["node", "-e", code], capture_output=True, text=True, check=True, timeout=60)
    index = json.loads(files[1].read_text("utf-8").partition("= ")[2].rstrip(";\n"))
    for query, line in zip(QUESTIONS, done.stdout.splitlines(), strict=True):
        assert json.loads(line)[:5] == hits(index, query)[:5]
    assert sorted(file.name for file in site.joinpath("search").iterdir()) == ["index.js", "main.js"]


def test_a_broken_link_is_noticed(tmp_path):
    docs = tmp_path / "docs"
    docs.mkdir()
    docs.joinpath("index.md").write_text("[nowhere](no_such_page.md)\n")
    config = ROOT.joinpath("mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[0]
    config = config.replace("docs/generate/", f"{ROOT.as_posix()}/docs/generate/")
    tmp_path.joinpath("mkdocs.yml").write_text(f"{config}\nnav: [index.md]\n")
    done = built(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert done.returncode != 0
    assert "no_such_page.md" in done.stderr


def test_formulas_in_sentences_have_indices_and_exponents():
    html = '<p>y_3^2/4 and h^(1/2) at 2^-4, 2*10^5 paths, dW_k; <code>y_3^2</code> <a href="a_b^2">10^-3 +- 1</a></p>'
    shown = (
        "<p>y<sub>3</sub><sup>2</sup>/4 and h<sup>1/2</sup> at 2<sup>\N{MINUS SIGN}4</sup>, 2 × 10<sup>5</sup> paths, "
    )
    shown += 'dW<sub>k</sub>; <code>y_3^2</code> <a href="a_b^2">10<sup>\N{MINUS SIGN}3</sup> ± 1</a></p>'
    assert with_signs(html) == shown
    assert with_signs("h^2. At 2^-4.5") == "h<sup>2</sup>. At 2<sup>\N{MINUS SIGN}4.5</sup>"
    kept = "<p>noise_flow, some_name and a^b in <pre>x^2</pre></p>"
    assert with_signs(kept) == kept.replace("a^b", "a<sup>b</sup>")


def test_parts_of_a_formula_may_stand_below_each_other():
    assert mathml(r"a = b, \qquad c = d").count("<math ") == 2
    assert mathml(r"\qquad - a").count("<math ") == 1 == mathml(r"\left\{ a \qquad b \right\}").count("<math ")
    assert mathml("a \\\\\nb").count("<div>") == 2
