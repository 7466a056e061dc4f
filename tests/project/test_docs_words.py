"""The words, the sentences and the examples of the pages; formulas of the reference in signs."""

import re
import sys
import unicodedata

import pytest
from documents import PAGES, ROOT, avoided, first_example, page_name, sentences

sys.path.append(str(ROOT / "docs" / "generate"))
import words


def test_formulas_in_signs():
    assert words.in_symbols("H = sum_k y_k^2 / (2 I_k), Ĥ_1") == "H = Σₖ yₖ² / (2 Iₖ), Ĥ₁"
    assert words.in_symbols("sigma_k dW_k grad Ĥ_k, |omega_m|^2") == "σₖ dWₖ ∇Ĥₖ, |ωₘ|²"
    kept = "omega_{m+n}, noise_flow, xi^(n-1), h^0.5, summary, epsilon"
    assert words.in_symbols(kept) == kept.replace("omega", "ω").replace("xi", "ξ")


def test_the_glossary_is_in_alphabetical_order():
    lines = ROOT.joinpath("docs", "glossary.md").read_text(encoding="utf-8").splitlines()
    entries = [line.split(" | ")[0].strip("| ") for line in lines if line.startswith("| ")][1:]
    assert len(entries) > 40
    plain = [unicodedata.normalize("NFKD", entry).encode("ascii", "ignore").decode().lower() for entry in entries]
    assert [entry.replace("-", " ") for entry in plain] == sorted(entry.replace("-", " ") for entry in plain)


#: Pages that people write; the gallery and the reference are written by programs.
WRITTEN = [page for page in PAGES if page.parent != ROOT / "docs" / "reference" and page.stem != "gallery"]
WRITTEN.remove(ROOT / "CONTRIBUTING.md")  # for those who work on the code, in its words
#: Pages that are looked up, which need no example.
LOOKED_UP = {"glossary", "platforms", "public", "security"}

#: Of a page to be read in one go, code and tables included.
MOST_WORDS = 2000
#: Longer pages, and why, where no comment on their first lines does: `<!-- long because: ... -->`.
LONG = {
    "gallery": "pictures of all experiments, written by a program",
    "spins": "magnets from the keys to correlations, for readers who use nothing else",
}


def why_long(text):
    """The reason that the first lines of a page give for its length; None where they give none."""
    found = re.search(r"^<!-- long because: (\w.*?) -->$", "\n".join(text.splitlines()[:4]), re.MULTILINE)
    return found and found[1]


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/*.md")), ids=page_name)
def test_a_long_page_says_why(page):
    text = page.read_text(encoding="utf-8")
    words = len(text.split())
    short = f"{words} words: move measurements and derivations to docs/appendix/{page.name}, or say why it is long"
    assert words <= MOST_WORDS or page.stem in LONG or why_long(text), short


def test_a_long_page_without_a_reason_is_noticed():
    page = "# A page\n<!-- long because: it lists all -->\n\nWords."
    assert why_long(page) == "it lists all"
    assert why_long(page.replace("long because: it lists all", "long because: ")) is None
    assert why_long(page.replace("long because", "within")) is None
    assert why_long("# A page\n\nWords.\n\nMore.\n\n" + page) is None


@pytest.mark.parametrize("page", WRITTEN, ids=page_name)
def test_the_words_of_a_page(page):
    """None to avoid, and sentences that are short on average."""
    text = page.read_text(encoding="utf-8")
    assert not [*avoided(text)]
    lengths = [len(sentence.split()) for sentence in sentences(text)]
    assert sum(lengths) <= 25 * len(lengths)


def test_words_to_avoid_are_noticed():
    text = "It tells so many.\n\n```sh\nspi run told\n```\n\n| beside |\n\n"
    text += "* `told` is code, [told](told.md) lies\n  beside. Fine it is."
    found = ["tells", "so many", "beside", "told", "lies"]
    assert [line.partition(" (")[0] for line in avoided(text)] == [f"'{word}'" for word in found]
    assert [*map(len, map(str.split, sentences(text)))] == [4, 6, 3]
    assert not [*avoided("The rule of Lie and Trotter goes on for 3 steps, so many that it ends.")]


@pytest.mark.parametrize("page", [page for page in WRITTEN if page.stem not in LOOKED_UP], ids=page_name)
def test_a_page_has_an_example_in_its_first_screen(page):
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# ") and not text.partition("\n\n")[2].startswith(("```", "#", "|", "!"))  # what it is for
    screen = 2400 if page.stem == "README" else 1200
    assert first_example(text) is not None and first_example(text) < screen


def test_a_page_without_an_example_is_noticed():
    assert first_example("# A page\n\nWords.\n\n```text\nspi run\n```\n") is None
    assert first_example("# A page\n\n" + 1200 * "w" + "\n\n```sh\nspi run\n```\n") > 1200
