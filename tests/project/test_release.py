"""What a release says of itself: one name, one version, one place for addresses, a readme that reads elsewhere."""

import ast
import re
import subprocess
import sys
import tomllib

import bounds
import pytest
import yaml
from documents import ROOT
from packaging.specifiers import SpecifierSet

import spi
from spi.cli import app
from spi.kinds import KINDS
from spi.plugins import offers
from spi.running import shipped

PROJECT = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text(encoding="utf-8"))
FILES = ("README.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml", "CITATION.cff", "mkdocs.yml", "setup.py")
FOLDERS = ("spi", "docs", "benchmarks", "experiments", ".ci")
TEXTS = {".py", ".md", ".yaml", ".html", ".ipynb", ".toml", ".cff", ".yml", ".jinja", ""}


def text_of(path):
    return ROOT.joinpath(path).read_text(encoding="utf-8")


def texts():
    """Everything that a reader may see, by its path."""
    below = (path for folder in FOLDERS for path in ROOT.joinpath(folder).rglob("*"))
    for path in [*(ROOT / name for name in FILES), *below]:
        if path.is_file() and path.suffix in TEXTS and "__pycache__" not in path.parts:
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


#: `pip install spi`, with options, quotes or extras; not a wheel or a folder, and not a name that goes on.
OF_ANOTHER = re.compile(r"pip3? (?:install|download)(?: -[-\w]+)* ['\"]?spi(?![\w.-]*\.whl)(?![\w/.-])")


def test_nothing_tells_to_install_the_other_program_of_that_name():
    assert [path for path, text in texts() if OF_ANOTHER.search(text)] == []


def test_name_and_version_are_the_same_everywhere():
    assert PROJECT["project"]["name"] == spi.DISTRIBUTION
    citation = yaml.safe_load(text_of("CITATION.cff"))
    assert citation["version"] == spi.__version__ and citation["license"] == PROJECT["project"]["license"]
    assert citation["keywords"] == PROJECT["project"]["keywords"] and citation["date-released"].year >= 2026
    assert citation["preferred-citation"]["url"] == "https://arxiv.org/abs/2111.07387" and citation["abstract"]
    wheels = {name for _, text in texts() for name in re.findall(r"\w+-[\d.]+-py3-none-any\.whl", text)}
    assert wheels == {f"{spi.DISTRIBUTION.replace('-', '_')}-{spi.__version__}-py3-none-any.whl"}
    assert re.findall(r"version = \{(.*)\}", ROOT.joinpath("docs", "cite.md").read_text(encoding="utf-8")) == [
        spi.__version__
    ]
    changelog = ROOT.joinpath("CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## ([\d.]+)", changelog, re.MULTILINE)[0] == spi.__version__


def test_addresses_of_the_project_stand_in_one_place():
    source = PROJECT["project"].get("urls", {}).get("Source")
    assert source is None or [path for path, text in texts() if source in text] == ["pyproject.toml"]
    made_up = "example" + ".org"
    assert [path for path, text in texts() if made_up in text] == []


def test_the_readme_shows_pictures_and_links_elsewhere():
    """Its relative links, which an index of packages cannot follow, are whole addresses in the package, or text."""
    source = "https://host/someone/spi"
    script = "import setuptools; setuptools.setup = lambda **given: print(given['long_description']); import setup; "
    script += f"print('<end>', setup.readme({source!r}), '<end>', setup.readme(None))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, encoding="utf-8", check=True, timeout=60
    )
    installed, whole, bare = (text.strip() for text in done.stdout.split("<end>"))
    assert installed == bare if "urls" not in PROJECT["project"] else installed != bare
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", whole)
    assert len(links) > 20 and all(target.startswith(("https://", "#")) for _, target in links)
    pictures = [target for mark, target in links if mark]
    assert f"{source}/raw/v{spi.__version__}/docs/gallery/rigid_body_strong.png" in pictures
    here = {target.partition(f"/v{spi.__version__}/")[2] for _, target in links if target.startswith(source)}
    assert all(ROOT.joinpath(path).is_file() for path in here)
    kept = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", bare)
    assert all(target.startswith(("https://", "#")) and source not in target for _, target in kept)
    assert kept == [link for link in links if not link[1].startswith(source)] and "![" not in bare


@pytest.mark.needs
def test_the_readme_is_short_and_counts_the_experiments():
    text = text_of("README.md")
    assert len(text.splitlines()) <= 120
    assert f"one of {len(shipped.names())} that come with the program" in " ".join(text.split())
    assert "\nmake demo " in text and "\nmake test " in text
    kinds = re.findall(r"^\| \[`(\w+)`\]", text, re.MULTILINE)
    assert sorted(kinds) == sorted(KINDS)
    spec = re.search(r"```yaml\n(.*?)```", text, re.DOTALL)[1]
    shown, whole = (
        yaml.safe_load(spec),
        yaml.safe_load(shipped.path_of("rigid_body_strong").read_text(encoding="utf-8")),
    )
    assert shown == {key: whole[key] for key in shown}


# --- what it needs ---------------------------------------------------------------------------------------------------

#: Modules that come with a package of another name, and the packages that always bring them along.
BROUGHT = {
    **{"yaml": "pyyaml", "annotated_types": "annotated-types", "mpl_toolkits": "matplotlib"},
    **{"llvmlite": "numba", "markupsafe": "jinja2", "pydantic_core": "pydantic"},
}


def imported():
    """The names of all packages of others that the program imports."""
    for file in ROOT.joinpath("spi").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and not node.level else []
            yield from (name.partition(".")[0] for name in names)


@pytest.mark.needs
def test_what_is_imported_is_declared_and_nothing_else():
    packages = {BROUGHT.get(name, name) for name in imported()} - {*sys.stdlib_module_names, "spi"}
    optional = {bounds.named(one)[0] for one in PROJECT["project"]["optional-dependencies"]["dask"]}
    assert packages == {*bounds.needed(), *optional}


def test_bounds_are_told_and_hold_for_the_pinned_versions():
    needed, pinned = bounds.needed(), bounds.pinned()
    assert all(bounds.lower(one) for one in needed.values()) and "<" not in needed["numba"]
    assert {name for name, one in needed.items() if pinned[name] not in SpecifierSet(one)} == set()
    at_least = {"typer": "0.28", "pydantic": "2.11.7", "xarray": "2024.10"}
    assert {name: bounds.lower(needed[name]) for name in at_least} == at_least
    (built_by,) = PROJECT["build-system"]["requires"]
    assert "==" not in built_by and pinned["setuptools"] in SpecifierSet(bounds.named(built_by)[1])


def test_oldest_and_newest_environments():
    oldest, newest = bounds.oldest(), bounds.newest()
    assert oldest["numba"] == "0.62" and "llvmlite" not in oldest and oldest["ruff"] == bounds.pinned()["ruff"]
    assert newest["numba"] is newest["rich"] is None and newest["pytest"] == bounds.pinned()["pytest"]


# --- what is promised ------------------------------------------------------------------------------------------------


@pytest.mark.needs
def test_the_page_of_stable_names_lists_all_of_them():
    page = ROOT.joinpath("docs", "public.md").read_text(encoding="utf-8")
    commands = {command.name or command.callback.__name__ for command in app.registered_commands}
    rows = [line for line in page.splitlines() if line.startswith("|")]
    names, listed = (set(re.findall(r"`(?:spi )?(\w+)`", line.partition(" | ")[0])) for line in rows[2:4])
    assert names == {*spi.__all__, *offers("offered")} and listed == commands
