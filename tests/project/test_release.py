"""What a release says of itself: one name, one version, one place for addresses, a readme that reads elsewhere."""

import re
import subprocess
import sys
import tomllib

import pytest
import yaml
from documents import ROOT

import spi

PROJECT = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text(encoding="utf-8"))
FILES = ("README.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml", "CITATION.cff", "mkdocs.yml", "setup.py")
FOLDERS = ("spi", "docs", "benchmarks", "experiments", ".ci")
TEXTS = {".py", ".md", ".yaml", ".html", ".ipynb", ".toml", ".cff", ".yml", ".jinja", ""}


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


@pytest.mark.parametrize(
    "wrong", ["pip install spi", "pip install 'spi[dask]'", "pip install -U spi", "pip install spi;"]
)
def test_such_advice_would_be_noticed(wrong):
    assert OF_ANOTHER.search(wrong)
    for right in (spi.DISTRIBUTION, f"'{spi.DISTRIBUTION}[dask]'", "spi-0.2.0-py3-none-any.whl", "./spi"):
        assert not OF_ANOTHER.search(f"pip install {right}")


def test_name_and_version_are_the_same_everywhere():
    assert PROJECT["project"]["name"] == spi.DISTRIBUTION
    citation = yaml.safe_load(ROOT.joinpath("CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == spi.__version__
    wheels = {name for _, text in texts() for name in re.findall(r"\w+-[\d.]+-py3-none-any\.whl", text)}
    assert wheels == {f"{spi.DISTRIBUTION.replace('-', '_')}-{spi.__version__}-py3-none-any.whl"}
    changelog = ROOT.joinpath("CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## ([\d.]+)", changelog, re.MULTILINE)[0] == spi.__version__


def test_addresses_of_the_project_stand_in_one_place():
    source = PROJECT["project"]["urls"]["Source"]
    assert [path for path, text in texts() if source in text] == ["pyproject.toml"]


def test_the_readme_shows_pictures_and_links_elsewhere():
    """Its relative links, which an index of packages cannot follow, are whole addresses in what is installed."""
    script = "import setuptools; setuptools.setup = lambda **given: print(given['long_description']); import setup"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, encoding="utf-8", check=True, timeout=60
    )
    source = PROJECT["project"]["urls"]["Source"]
    links = re.findall(r"(!?)\[[^\]]*\]\(([^)]+)\)", done.stdout)
    assert len(links) > 20 and all(target.startswith(("https://", "#")) for _, target in links)
    assert f"{source}/raw/v{spi.__version__}/docs/rigid_body_strong.png" in [target for mark, target in links if mark]
    here = {target.partition(f"/v{spi.__version__}/")[2] for _, target in links if target.startswith(source)}
    assert all(ROOT.joinpath(path).is_file() for path in here)
