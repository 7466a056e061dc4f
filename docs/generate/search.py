"""The index of the site's search as a script, so that it can be read from a folder, where a page may fetch no data.

An entry is a page or a section.  The weight of a word in an entry is decided here; the page only adds weights up.
"""

import json
import math
import re
import unicodedata
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

#: What a word in a title of one word (in one of n by the root of n less), and one in a heading of the page, counts in
#: times of the text.
TITLE, HEADING = 9.0, 1.5
#: A section counts less than a page with the same words, and lists of everything less than pages about one thing.
SECTION, LIST = 0.8, 0.4
LISTS = ("gallery.html", "reference/", "appendix/")
#: Words that say nothing of a page.
IGNORED = {
    *("a", "an", "and", "are", "can", "do", "does", "for", "how", "i", "in", "is", "it", "my", "of", "on", "or", "the"),
    *("to", "what", "where", "which", "with"),
}
#: What readers may write, and the word of the pages.
SYNONYMS = {"license": "licence", "citation": "cite", "cuda": "gpu", "queue": "slurm", "restart": "resume"}


def words(text: str) -> list[str]:
    """The words of a text without accents and plural endings; search.js does the same to what is typed."""
    plain = unicodedata.normalize("NFKD", text.lower())
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return [re.sub("(?<=[a-z]{3})(?<!s)s$", "", word) for word in re.findall("[a-z0-9]+", plain)]


def index(entries: list[dict[str, str]]) -> dict[str, Any]:
    """The entries, and for each word the numbers of its entries with weights: those of Okapi's BM25, and for titles."""
    titles = _titles(entries)
    entries = [entry for entry in entries if entry["location"] in titles]
    texts = [Counter(words(entry["text"])) for entry in entries]
    headings: dict[str, set[str]] = defaultdict(set)
    for location, title in titles.items():
        headings[location.partition("#")[0]] |= title
    mean = sum(text.total() for text in texts) / len(texts)
    contained = [{*text, *titles[entry["location"]]} for entry, text in zip(entries, texts, strict=True)]
    holders = Counter(word for each in contained for word in each)
    weights: dict[str, list[list[float]]] = defaultdict(list)
    for i, (entry, text) in enumerate(zip(entries, texts, strict=True)):
        page, _, section = entry["location"].partition("#")
        title = titles[entry["location"]] - IGNORED
        in_title = TITLE / math.sqrt(max(1, len(title)))
        factor = (SECTION if section else 1.0) * (LIST if page.startswith(LISTS) else 1.0)
        for word in sorted(contained[i] - IGNORED):
            often = text[word]
            weight = 2.2 * often / (often + 1.2 * (0.25 + 0.75 * text.total() / mean))
            weight += in_title * (word in title) + HEADING * (not section and word in headings[page])
            rare = math.log(1 + (len(entries) - holders[word] + 0.5) / (holders[word] + 0.5))
            weights[word].append([i, round(rare * weight * factor, 2)])
    for word, known in SYNONYMS.items():  # and pages that have the word itself
        weights[word] = weights.get(word, []) + weights[known]
    shown = [[entry["location"], entry["title"], _summary(entry)] for entry in entries]
    return {"entries": shown, "weights": weights, "ignored": sorted(IGNORED)}


def _summary(entry: dict[str, str]) -> str:
    """The beginning of an entry, without the marks of links to headings and without its title."""
    text = entry["text"].replace("\N{PILCROW SIGN} ", "")
    title, _, rest = text.partition(entry["title"] + " ")
    return (text if title else rest)[:200]


def _titles(entries: list[dict[str, str]]) -> dict[str, set[str]]:
    """The words of the titles by location; the first heading of a page is no section of its own, but its title too."""
    titles: dict[str, set[str]] = {}
    page = None
    for entry in entries:
        title = set(words(entry["title"]))
        if "#" not in entry["location"]:
            page, titles[entry["location"]] = entry["location"], title
        elif page is not None:
            titles[page] |= title
            page = None
        else:
            titles[entry["location"]] = title
    return titles


def script(read: str) -> str:
    """The index that the search plugin of MkDocs made, as a script."""
    return f"var search_index = {json.dumps(index(json.loads(read)['docs']), separators=(',', ':'))};\n"


def write(folder: Path) -> None:
    """Replace the files of the search plugin in the site."""
    made = folder / "search_index.json"
    folder.joinpath("index.js").write_text(script(made.read_text(encoding="utf-8")), encoding="utf-8")
    folder.joinpath("main.js").write_text(Path(__file__).with_suffix(".js").read_text("utf-8"), encoding="utf-8")
    for name in ("search_index.json", "worker.js", "lunr.js"):
        folder.joinpath(name).unlink(missing_ok=True)
