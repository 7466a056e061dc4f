"""The documentation: every command and every block of YAML or Python in it is what the program knows."""

import re
import shlex
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from documents import PAGES, ROOT, Wrong, blocks_of, check_command, commands_of, missing_lines, whole

from spi import cli
from spi.runs import load
from spi.spec import SpecError

sys.path.append(str(ROOT / "docs" / "generate"))
import reference

LANGUAGES = ("", "python", "sh", "text", "toml", "yaml")
IDS = {"argvalues": PAGES, "ids": lambda page: str(page.relative_to(ROOT))}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder in which the reader of a page works: with the experiments, and with the model of the examples."""
    tmp_path.joinpath("experiments").symlink_to(ROOT / "experiments")
    tmp_path.joinpath("systems").symlink_to(ROOT / "experiments" / "systems")
    tmp_path.joinpath("my_top.py").symlink_to(ROOT / "tests" / "heavy_top.py")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def spi(folder, monkeypatch, capfd):
    """spi(argument, ...) -> (exit code, all that it prints)."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def call(*arguments):
        capfd.readouterr()
        monkeypatch.setattr(sys, "argv", ["spi", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code, "".join(capfd.readouterr())

    yield call
    for number, handler in handlers.items():
        signal.signal(number, handler)


# --- blocks and commands ---------------------------------------------------------------------------------------------


def check_yaml(block):
    """Wrong unless the block is a valid spec, alone or within another."""
    path = Path(block.notes.get("file", f"block_{block.line}.yaml"))
    path.write_text(whole(block), encoding="utf-8")
    try:
        load(path)
    except SpecError as error:
        raise Wrong(f"{block.place}: {error}") from error


def check_python(block):
    """Wrong unless the block runs, or can be compiled if it is not to be run."""
    try:
        code = compile(block.text, block.place, "exec")
        if "compiled only" not in block.notes:
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


@pytest.mark.parametrize("page", **IDS)
def test_blocks_and_commands(page, folder):
    check_page(page, page.read_text(encoding="utf-8"))


SPEC = ROOT.joinpath("experiments", "lotka_volterra_positivity.yaml").read_text(encoding="utf-8")
GOOD = f"""
See `spi plot FILE` and `spi run --part`; `results.plot()` is no command, and neither is `import spi`.

```yaml
{SPEC}```

<!-- within: rigid_body_strong -->
```yaml
samples: 10^4
```

<!-- within: spin_ring_strong, model -->
```yaml
system: systems/spin_ring.yaml
sizes: {{n: 3}}
```

```sh
make demo
spi run lotka_volterra_positivity --set seed=2 --max-time 3h    # the experiment
seq 4 | parallel spi run SPEC --part {{}}/4
```

```python
assert 1 + 1 == 2
```
"""


def test_a_page_without_mistakes(folder):
    check_page(Path("page.md"), GOOD)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("kind: trajectory", "kind: trajectory\nsamplse: 3", "page.md:4: block_4.yaml:.*samplse"),
        ("samples: 10^4", "samples: 0", "page.md:.*samples"),
        ("samples: 10^4", "smaples: 10", "page.md:.*smaples"),
        ("sizes: {n: 3}", "sises: {n: 3}", "page.md:.*sises"),
        ("<!-- within: rigid_body_strong -->", "", "is no whole spec"),
        ("--max-time", "--maxtime", "no such option: --maxtime"),
        ("--set seed=2", "--set sede=2", "sede"),
        ("--part {{}}/4", "--prat {{}}/4", "--prat"),
        ("spi run lotka_volterra_positivity", "spi run lotka_volterra", "lotka_volterra: no such file"),
        ("spi run lotka", "spi ran lotka", "ran"),
        ("make demo", "mkae demo", "calls none of spi, cd, make"),
        ("`spi plot FILE`", "`spi plot FILE --flim`", "no such option: --flim"),
        ("`spi run --part`", "`spi rnu --part`", "rnu"),
        ("1 + 1 == 2", "1 + 1 == 3", "page.md"),
        ("1 + 1 == 2", "1 + 1 === 2", "page.md"),
        ("```python", "```pyhton", "has the language pyhton"),
    ],
)
def test_a_mistake_in_a_page_is_noticed(folder, right, wrong, message):
    right, wrong = right.replace("{{}}", "{}"), wrong.replace("{{}}", "{}")
    assert right in GOOD
    with pytest.raises(Wrong, match=message):
        check_page(Path("page.md"), GOOD.replace(right, wrong, 1))


# --- what commands say -----------------------------------------------------------------------------------------------


def outputs():
    for page in PAGES:
        for block in blocks_of(page, page.read_text(encoding="utf-8")):
            if "output of" in block.notes:
                yield pytest.param(block, id=block.place)


@pytest.mark.parametrize("block", [*outputs()])
def test_output_is_that_of_the_command(spi, block):
    program, *arguments = shlex.split(block.notes["output of"])
    assert program == "spi"
    _, said = spi(*arguments)
    assert missing_lines(block.text, said) == []


def test_other_output_is_noticed():
    said = "heavy_top:\n  6 variables\n  noise 1: G3: 2 shears\n"
    assert missing_lines("heavy_top:\n... variables\n", said) == []
    assert missing_lines("heavy_top:\n  7 variables\n", said) == ["  7 variables"]
    assert missing_lines("  noise 1: …\nheavy_top:\n", said) == ["heavy_top:"]  # the order counts


# --- other programs, and links ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", **IDS)
def test_targets_and_files_exist(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", ROOT.joinpath("Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    targets += [path.stem for path in ROOT.joinpath("experiments").glob("*.yaml")]
    for target in re.findall(r"(?:`|^)make ([a-z_-]+)", text, re.MULTILINE):
        assert target in targets
    for path in re.findall(r"\b(?:benchmarks|tests|experiments|spi)/[\w/]+\.(?:py|yaml)\b", text.replace("NAME.yaml", "")):
        assert ROOT.joinpath(path).is_file(), path


@pytest.mark.parametrize("page", PAGES[:2], ids=lambda page: page.name)
def test_links_lead_to_files(page):
    """Those of the pages in docs are checked by MkDocs."""
    links = re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8"))
    assert links
    for link in links:
        assert ROOT.joinpath(link).is_file(), link


# --- the site --------------------------------------------------------------------------------------------------------


def test_reference_is_that_of_the_code():
    pages = reference.pages()
    assert sorted(pages) == sorted(reference.FOLDER.glob("*.md"))
    for path, text in pages.items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name} is not that of the code; say `make docs`"


def test_reference_says_what_every_key_is():
    """A description for each key, and for each model, scheme and command its place."""
    pages = {path.stem: text for path, text in reference.pages().items()}
    for name in ("spec", "models", "commands"):
        assert not re.findall(r"^\|.*\| *\|$", pages[name], re.MULTILINE)
    assert "| `final_time` | number > 0 | time | **required** |" in pages["spec"]
    assert "| `seed` | whole number ≥ 0 |  | `1` |" in pages["spec"]
    for name, known in (("models", reference.MODELS), ("schemes", reference.SCHEMES), ("spec", reference.KINDS)):
        for entry in known:
            assert f"\n## {entry}\n" in pages[name]


def built(config, target):
    program = [sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file", config, "--site-dir", target]
    return subprocess.run(program, capture_output=True, text=True, check=False, timeout=120)


def test_site_builds_without_a_warning_and_needs_no_network(tmp_path):
    done = built(ROOT / "mkdocs.yml", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = [*tmp_path.rglob("*.html")]
    assert len(pages) > 20
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|iframe)[^>]* src="https?:', text), page
        assert not re.findall(r'<link[^>]* href="https?:', text), page
    for style in tmp_path.rglob("*.css"):
        assert not re.findall(r"url\(['\"]?https?:", style.read_text(encoding="utf-8")), style


def test_a_broken_link_is_noticed(tmp_path):
    docs = tmp_path / "docs"
    docs.mkdir()
    docs.joinpath("index.md").write_text("[nowhere](no_such_page.md)\n")
    config = ROOT.joinpath("mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[0]
    tmp_path.joinpath("mkdocs.yml").write_text(f"{config}\nnav: [index.md]\n")
    done = built(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert done.returncode != 0
    assert "no_such_page.md" in done.stderr
