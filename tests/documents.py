"""What stands in the pages of the documentation: blocks of code, the notes above them, and commands within sentences.

A note is a comment in HTML, which readers do not see, on a line above a block:

    <!-- within: NAME -->             of YAML: keys that stand in the first case of the experiment NAME
    <!-- within: NAME, model -->      of YAML: keys that stand under its key `model`
    <!-- in file: NAME -->            of YAML: lines that take the place of lines with the same keys in a file
    <!-- output of: spi ... -->       what a command says; ... or … stand for anything
    <!-- compiled only: reason -->    of Python: not run, because
"""

import re
import shlex
import textwrap
import tomllib
from pathlib import Path
from typing import NamedTuple

import typer
import yaml

from spi import plugins
from spi.cli import app, options
from spi.running import shipped
from spi.running.run import load
from spi.specs import SpecError

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]

#: What stands for a name of the reader's in commands.
PLACEHOLDERS = {
    **{"SPEC": "rigid_body_strong", "FILE": "results/rigid_body_strong.h5", "NAME": "rigid_body_strong"},
    **{"I/N": "1/4", "{}": "1", "ADDRESS": "local:2", "key=value": "seed=1"},
}
#: Pages whose Python other tests run, as one program.
RUN_BY_OTHERS = ("python.md", "integrator.md", "finite_size.md")
#: Other programs that a block of commands may call.
PROGRAMS = ("make", "pip", "python", "source", "#")

_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NOTES = re.compile(r"(?:^<!-- [a-z ]+: .*? -->\n)*\Z", re.MULTILINE)
_COMMAND = re.compile(r"(?<![\w/.'\[-])spi +([a-z][^;|&`]*)")


LANGUAGES = ("", "bibtex", "latex", "math", "python", "sh", "text", "toml", "yaml")


def page_name(page):
    """What a page is called among the tests."""
    return str(page.relative_to(ROOT))


class Block(NamedTuple):
    """A block of code of a page."""

    page: Path
    line: int
    language: str
    text: str
    notes: dict[str, str]

    @property
    def place(self):
        return f"{self.page.name}:{self.line}"


class Wrong(Exception):
    """Something in a page that the program does not know; the text says where and what."""


def blocks_of(page, text):
    """The blocks of a page in their order."""
    for found in _BLOCK.finditer(text):
        above = _NOTES.search(text[: found.start()])[0]
        notes = dict(re.findall(r"<!-- ([a-z ]+): (.*?) -->", above))
        yield Block(page, text.count("\n", 0, found.start()) + 1, found[1], found[2], notes)


class Command(NamedTuple):
    """A command in a page."""

    place: str
    arguments: list[str]
    spoken_of: bool  #: in a sentence, where it may lack something


def commands_of(page, text):
    """All commands of a page, those in blocks and those in sentences."""
    for block in blocks_of(page, text):
        yield from commands_in(block)
    sentences = _BLOCK.sub(lambda found: "\n" * found[0].count("\n"), text)
    for found in re.finditer(r"`(spi [a-z][^`]*)`", sentences):
        place = f"{page.name}:{sentences.count(chr(10), 0, found.start()) + 1}"
        yield from (Command(place, arguments, True) for arguments in _arguments(found[1]))


def commands_in(block):
    """The commands in a block; Wrong if a line of it calls something that is not known."""
    lines = block.text.replace("\\\n", " ").splitlines() if block.language == "sh" else ()
    for n, line in enumerate(lines, 1):
        found = list(_arguments(line.partition(" #")[0]))
        if line.strip() and not found and not line.startswith(PROGRAMS):
            raise Wrong(f"{block.place}: line {n} calls none of spi, {', '.join(PROGRAMS)}: {line}")
        yield from (Command(block.place, arguments, False) for arguments in found)


def _arguments(line):
    for found in _COMMAND.finditer(line):
        text = re.sub(r"\$\w+", "1", found[1].partition(" [")[0].replace("...", ""))
        for placeholder, value in PLACEHOLDERS.items():
            text = re.sub(rf"(?<![\w.]){re.escape(placeholder)}(?!\w)", value, text)
        yield shlex.split(text)


def whole(block):
    """The spec that a block of YAML is, or of which it is a part."""
    text = re.sub(r"\A\s*#.*\n", "", block.text)
    within = block.notes.get("within")
    if "in file" in block.notes:
        return changed(block, Path(block.notes["in file"]).read_text(encoding="utf-8"))
    if within is None:
        if not re.search("^kind:", text, re.MULTILINE):
            raise Wrong(f"{block.place}: is no whole spec; say <!-- within: NAME --> above of which it is a part")
        return text
    name, _, key = within.partition(", ")
    if key:
        text = f"{key}:\n" + textwrap.indent(text, "  ")
    base = yaml.safe_load(shipped.folder().joinpath(f"{name}.yaml").read_text(encoding="utf-8"))
    case = base.pop("cases", [{}])[0]
    model = {**base.get("model", {}), **case.get("model", {})}
    gone = {*re.findall(r"^(\w+):", text, re.MULTILINE), "name", "expect", "profiles"}
    kept = {k: v for k, v in {**base, **case, "model": model}.items() if k not in gone}
    return yaml.safe_dump(kept, default_flow_style=None) + text


def changed(block, text):
    """The text of a file with the lines of a block in place of its own; Wrong if it has not one line with that key."""
    for line in block.text.splitlines():
        key = re.match(r" *\w+:", line)[0]
        text, count = re.subn(rf"^{key}.*$", line, text, flags=re.MULTILINE)
        if count != 1:
            raise Wrong(f"{block.place}: {count} lines of the file begin with '{key}'")
    return text


def check_command(command):
    """Wrong unless the program knows a command with such options, and its experiments are valid; nothing is run."""
    try:
        given = _given(*command.arguments, spoken_of=command.spoken_of)
        results = [spec for spec in given.get("specs") or () if spec.suffix == ".h5"]
        if written := [spec for spec in given.get("specs") or () if spec not in results]:
            chosen = {name: given[name] for name in options.RunOptions._fields if name in given}
            options.load(written, options.RunOptions(**chosen))
        for source in [*(given.get("sources") or ()), *filter(None, [given.get("source")]), *results]:
            name = Path(source).name.partition(".")[0]
            if name not in shipped.names() and not Path(f"{name}.yaml").exists():
                raise Wrong(f"no experiment is called {name}")
    except Exception as error:
        raise Wrong(f"{command.place}: spi {shlex.join(command.arguments)}: {error}") from error


def _given(name, *rest, spoken_of):
    """The values of the options and arguments of a command, by their names in the program."""
    group = typer.main.get_command(app)
    with group.make_context("spi", [], resilient_parsing=True) as context:
        command = group.get_command(context, name)
        if command is None:
            raise Wrong(plugins.lacking("commands", name) or "no such command")
        named = {option for parameter in command.get_params(context) for option in parameter.opts}
        if unknown := next(
            (word for word in rest if word.startswith("--") and word.partition("=")[0] not in named), None
        ):
            raise Wrong(f"no such option: {unknown}")
        return command.make_context(name, list(rest), parent=context, resilient_parsing=spoken_of).params


def missing_lines(shown, said):
    """The lines of a block of output that a command does not say, in their order."""
    missing, start = [], 0
    for line in filter(str.strip, shown.splitlines()):
        pattern = ".*".join(re.escape(part.strip()) for part in re.split(r"\.\.\.|…", line))
        found = re.compile(pattern).search(said, start)
        if found is None:
            missing.append(line)
        else:
            start = found.end()
    return missing


def check_yaml(block):
    """Wrong unless the block is a valid spec, alone or within another."""
    path = Path(f"block_{block.line}.yaml")
    path.write_text(whole(block), encoding="utf-8")
    try:
        load(path)
    except SpecError as error:
        raise Wrong(f"{block.place}: {error}") from error


def check_python(block):
    """Wrong unless the block runs, or can be compiled if it is not to be run."""
    try:
        code = compile(block.text, block.place, "exec")
        if "compiled only" not in block.notes and block.page.name not in RUN_BY_OTHERS:
            exec(code, {"__name__": "page"})
    except Exception as error:
        raise Wrong(f"{block.place}: {error}") from error


def check_toml(block):
    tomllib.loads(block.text)


CHECKS = {"yaml": check_yaml, "python": check_python, "toml": check_toml}


def check_page(page, text):
    """Everything of a page that can be checked without computing; Wrong about the first thing that is not so."""
    for block in blocks_of(page, text):
        if block.language not in LANGUAGES:
            raise Wrong(f"{block.place}: has the language {block.language}; known: {', '.join(LANGUAGES)}")
        if block.language in CHECKS:
            CHECKS[block.language](block)
    for command in commands_of(page, text):
        check_command(command)


# --- prose -----------------------------------------------------------------------------------------------------------

#: Words that pages avoid, as patterns, and what stands in their place.
AVOID = {
    r"beside": "next to, in addition to, compared with",
    r"tells?|told": "states, shows, prints",
    r"lies|(?-i:lie)|lay(?= (?:in|on|at|behind)\b)": "is, are",
    r"so many(?! that)(?! \w+ that)": "the number",
    r"but for": "except for, up to",
    r"in place of": "instead of",
    r"whoever|whatever it is": "anyone who",
    r"as ever": "as usual",
    r"what comes out|what came out": "results",
    r"what is (?:not )?(?:had|known|told|said|named|kept|lost|wanted|asked)": "the noun itself",
    r"(?:goes?|gone|going) on(?! for)": "continues, resumes",
    r"asks? (?:for|of)|asked for": "needs, requires",
    r"two roads|its mood|one likes|by turns|be it": "the plain word",
    r"for good": "permanently",
    r"shall": "must, will",
}


def sentences(text):
    """The sentences of a page that are prose: no code, tables, headings or formulas; a link is its text."""
    text = re.sub(r"<!--.*?-->", "", _BLOCK.sub("\n\n", text), flags=re.DOTALL)
    text = re.sub(r"^(?: {4}|\||#|!\[).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^ *(?:[*-]|\d+\.) ", "\n\n", text, flags=re.MULTILINE)
    text = re.sub(r"`[^`]*`", "`code`", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text))
    for paragraph in re.split(r"\n\s*\n", text):
        parts = re.split(r"(?<=[.?!:;])\s+(?=[A-Z(`*])", " ".join(paragraph.split()))
        yield from (part for part in parts if len(part.split()) > 1)


def avoided(text):
    """The words of a page that it should avoid, each with the sentence and what to write."""
    for sentence in sentences(text):
        for pattern, instead in AVOID.items():
            for found in re.findall(rf"\b(?:{pattern})\b", sentence, re.IGNORECASE):
                yield f"'{found}' (write {instead}): {sentence}"


def first_example(text):
    """How many characters stand before the first block that a reader can run or paste; None if there is none."""
    text = re.sub(r"^<!--.*?-->\n", "", text, flags=re.MULTILINE)
    found = re.search(r"^```(?:sh|yaml|python|bibtex)$", text, re.MULTILINE)
    return found and found.start()
