"""A package outside the repository with an entry point is a plug-in like the others."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import spi_oscillator

import spi
from spi import plugins
from spi.models import MODELS

SOURCE = Path(spi_oscillator.__file__)
PAGE = Path(__file__).parents[2] / "docs" / "dev" / "plugins.md"
SPEC = """\
kind: energy_growth
model: {name: oscillator, sigma: [0.5]}
initial: [1, 0]
final_time: 1
step: 2^-3
schemes: [splitting_symmetric]
samples: 1000
expect: {splitting_symmetric: {energy: 0.625 +- 0.06}}
"""


def install(folder, text=None, name="spi_made_up"):
    """Put a package with a plug-in into a folder, as pip does; the example, or one with a text and a name."""
    name = "spi_oscillator" if text is None else name
    folder.joinpath(f"{name}.py").write_text(text or SOURCE.read_text(encoding="utf-8"), encoding="utf-8")
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    about.joinpath("METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    entry = f"[{plugins.GROUP}]\nany = {name}:PLUGIN\n"
    about.joinpath("entry_points.txt").write_text(entry, encoding="utf-8")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder of packages beside the installed ones."""
    monkeypatch.syspath_prepend(tmp_path)
    plugins.installed.cache_clear()
    yield tmp_path
    sys.modules.pop("spi_made_up", None)
    monkeypatch.undo()
    plugins.installed.cache_clear()


def test_the_page_shows_the_example():
    assert SOURCE.read_text(encoding="utf-8").split('"""\n', 1)[1].strip() in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("field", [field for field in plugins.Plugin._fields if field != "name"])
def test_the_page_names_each_field(field):
    assert re.search(rf"^\|[^|]*`{field}`", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_its_model_its_kind_and_its_function_are_those_of_the_program(elsewhere):
    """Uncompiled, since nothing else needs these kernels."""
    install(elsewhere)
    elsewhere.joinpath("s.yaml").write_text(SPEC, encoding="utf-8")
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(elsewhere), str(Path(spi.__file__).parents[1])]),
        "NUMBA_DISABLE_JIT": "1",
    }

    def answer(*arguments):
        program = [sys.executable, "-c", "from spi.cli import main; main()", *arguments]
        return subprocess.run(program, cwd=elsewhere, env=environment, capture_output=True, text=True)

    ran = answer("run", "s.yaml")
    assert ran.returncode == 0, ran.stderr
    assert "claims: 1 confirmed" in ran.stderr and "energy (95 %)" in ran.stdout
    assert answer("plot", "s.yaml").returncode == 0 and elsewhere.joinpath("results", "s.png").stat().st_size > 1000
    assert MODELS.name_of(spi_oscillator.Oscillator) == "oscillator" and spi.energy_rate(0.5) == 0.125
    assert "energy_rate" in dir(spi)


MADE_UP = """
from spi.plugins import Plugin

PLUGIN = Plugin("made_up", offered={"count": "math:sqrt"})
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1/", "cannot be read (invalid syntax (<unknown>, line 1)), must be a spi.plugins.Plugin(...) of plain texts"),
        ("PLUGIN = 3", "cannot be read (spi_made_up.py has no line PLUGIN = Plugin(...)), must be"),
        (MADE_UP.replace('"math:sqrt"', "1/0"), "cannot be read (malformed node"),
        (MADE_UP.replace("offered", "ofered"), "unexpected keyword argument 'ofered'"),
    ],
)
def test_one_that_cannot_be_used_is_named(elsewhere, text, message):
    install(elsewhere, text)
    with pytest.raises(plugins.PluginError, match=re.escape(message)):
        plugins.installed()


def test_names_that_two_plugins_have_are_refused(elsewhere):
    install(elsewhere, MADE_UP)
    install(elsewhere, MADE_UP.replace("made_up", "other"), "spi_other")
    with pytest.raises(plugins.PluginError, match="two plug-ins have offered called 'count'; uninstall one of them"):
        plugins.offers("offered")


def test_two_plugins_of_one_name_are_refused(elsewhere):
    install(elsewhere, MADE_UP)
    install(elsewhere, MADE_UP, "spi_other")
    with pytest.raises(plugins.PluginError, match="two plug-ins are called 'made_up'; rename or uninstall"):
        plugins.installed()


def test_one_whose_needs_are_not_here_is_not_here(elsewhere):
    install(elsewhere, MADE_UP.replace("offered=", "needs=('nothing',), offered="))
    assert "made_up" not in plugins.installed()
