"""The rules of plug-ins: the core knows none of them, each can be left out, and one may come from elsewhere."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from test_floors import PACKAGE, imports

from spi import plugins

FOLDER = PACKAGE / "plugins"
NAMES = sorted(path.parent.name for path in FOLDER.glob("*/plugin.py"))

#: Words of each plug-in, as regular expressions, that stand nowhere in ``spi/`` but in its own folder and in those of
#: plug-ins that need it.
WORDS = {
    "fluids": [],
    "spins": [],
    "report": [r"page\.html", "jinja", "latex2mathml", "longtable"],
}

#: Offences of today, (file, word), which only become fewer.
ALLOWED: set[tuple[str, str]] = set()


def modules(folder):
    """(dotted name, text, whether it is a package) of the Python files below a folder of the package."""
    for file in sorted(folder.rglob("*.py")):
        parts = ("spi", *file.relative_to(PACKAGE).with_suffix("").parts)
        yield ".".join(parts).removesuffix(".__init__"), file.read_text(encoding="utf-8"), file.name == "__init__.py"


def plugin_of(name):
    """The plug-in that a dotted name of the package lies in; None for the core."""
    parts = name.split(".")
    return parts[2] if parts[:2] == ["spi", "plugins"] and len(parts) > 2 and parts[2] in NAMES else None


def test_the_core_imports_no_plugin_and_a_plugin_only_those_that_it_needs():
    offences = []
    for module, text, is_package in modules(PACKAGE):
        here = plugin_of(module)
        needs = {here, *(plugins.installed()[here].needs if here else ())}
        for line, name in imports(text, module, is_package):
            if (there := plugin_of(name)) and there not in needs:
                offences.append(f"{module}:{line} imports {name}")
    assert offences == []


def test_plugins_need_one_another_in_no_circle():
    done, needs = set(), {name: {*plugins.installed()[name].needs} for name in NAMES}
    while ready := [name for name in needs if name not in done and needs[name] <= done]:
        done |= {*ready}
    assert done == {*NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_words_of_a_plugin_stand_in_its_folder_only(name):
    users = {name, *(other for other in NAMES if name in plugins.installed()[other].needs)}
    offences = set()
    for file in PACKAGE.rglob("*.py"):
        relative = file.relative_to(PACKAGE)
        if relative.parts[0] == "plugins" and {*relative.parts[1:2]} <= users:
            continue
        text = file.read_text(encoding="utf-8").lower()
        offences |= {(relative.as_posix(), word) for word in WORDS[name] if re.search(word, text)}
    assert offences <= ALLOWED
    mine = {word for _, word in ALLOWED if word in WORDS[name]}
    assert {word for _, word in offences} >= mine  # what is mended leaves the list


def test_the_index_says_which_plugin_has_what():
    index = json.loads((FOLDER / plugins.INDEX).read_text(encoding="utf-8"))
    fields = [field for field in plugins.Plugin._fields if field not in ("name", "needs")]
    own = {field: {} for field in fields}
    for name in NAMES:
        for field in fields:
            own[field] |= dict.fromkeys(getattr(plugins.installed()[name], field), name)
    assert index == {field: names for field, names in own.items() if names}


@pytest.mark.parametrize("field", [field for field in plugins.Plugin._fields if field not in ("name", "needs")])
def test_all_that_is_offered_is_there(field):
    for name, place in plugins.offers(field).items():
        if field == "kinds":
            plugins.import_module(place)
            continue
        thing = plugins.imported(place)
        if isinstance(thing, type):  # so that its name is known of the class alone, see Registry.name_of
            assert f"{thing.__module__}:{thing.__qualname__}" == place, name


def copy_without(names, tmp_path):
    """A copy of the package without some plug-ins, and the environment of programs that use it."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "spi", ignore=ignored)
    shutil.copytree(PACKAGE.parent / "experiments", tmp_path / "experiments", ignore=ignored)
    for name in names:
        shutil.rmtree(tmp_path / "spi" / "plugins" / name)
    return os.environ | {"PYTHONPATH": str(tmp_path)}


def spi(environment, folder, *arguments):
    """The outcome of `spi` with these arguments."""
    program = [sys.executable, "-c", "from spi.cli import main; main()", *arguments]
    return subprocess.run(program, cwd=folder, env=environment, capture_output=True, text=True)


def test_without_a_plugin_the_others_answer_and_its_names_are_explained(tmp_path):
    environment = copy_without(NAMES, tmp_path)
    answer = spi(environment, tmp_path, "--help")
    assert answer.returncode == 0 and " run " in answer.stdout and " report " not in answer.stdout
    kinds = json.loads((FOLDER / plugins.INDEX).read_text(encoding="utf-8")).get("kinds", {})
    for kind, plugin in list(kinds.items())[:1]:
        (tmp_path / "s.yaml").write_text(f"kind: {kind}\n", encoding="utf-8")
        answer = spi(environment, tmp_path, "check", "s.yaml")
        assert answer.returncode == 2
        assert answer.stderr == f"spi: s.yaml:1: kind: is '{kind}'; install the plug-in {plugin}, which has it\n"


@pytest.mark.slow
def test_the_rigid_body_needs_no_plugin(tmp_path):
    answer = spi(copy_without(NAMES, tmp_path), tmp_path, "run", "rigid_body_strong", "--profile", "quick")
    assert answer.returncode == 0, answer.stderr


def test_help_imports_no_more_of_a_plugin_than_its_commands():
    program = "import sys, spi.cli; print(*[name for name in sys.modules if name.startswith('spi.plugins.')])"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    for name in answer.stdout.split():
        assert name.count(".") == 2 or name.rpartition(".")[2] in ("plugin", "command"), name


OUTSIDE = '''
from typing import Annotated, NamedTuple

from spi.plugins import Plugin


def count():
    """Return three."""
    return 3


PLUGIN = Plugin("counting", offered={"count": "spi_counting:count"})
'''


def outside(folder, text=OUTSIDE, object_name="PLUGIN"):
    """Install a package with a plug-in into a folder, as pip does."""
    (folder / "spi_counting.py").write_text(text, encoding="utf-8")
    about = folder / "spi_counting-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: spi-counting\nVersion: 1.0\n", encoding="utf-8")
    entry = f"[{plugins.GROUP}]\ncounting = spi_counting:{object_name}\n"
    (about / "entry_points.txt").write_text(entry, encoding="utf-8")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder of packages beside the installed ones."""
    monkeypatch.syspath_prepend(tmp_path)
    plugins.installed.cache_clear()
    yield tmp_path
    sys.modules.pop("spi_counting", None)
    monkeypatch.undo()
    plugins.installed.cache_clear()


def test_a_package_with_an_entry_point_is_a_plugin(elsewhere):
    import spi

    outside(elsewhere)
    assert plugins.installed()["counting"].offered and spi.count() == 3 and "count" in dir(spi)


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("1/0", "PLUGIN", "cannot be loaded (ZeroDivisionError: division by zero); mend or uninstall it"),
        ("PLUGIN = 3", "PLUGIN", "is a int, must be a spi.plugins.Plugin; mend or uninstall it"),
        (OUTSIDE.replace('"counting"', '"report"'), "PLUGIN", "two plug-ins are called 'report'; rename or uninstall"),
    ],
)
def test_a_plugin_that_cannot_be_used_is_named(elsewhere, text, name, message):
    outside(elsewhere, text, name)
    with pytest.raises(plugins.PluginError, match=re.escape(message)):
        plugins.installed()


def test_one_whose_needs_are_not_here_is_not_here(elsewhere):
    outside(elsewhere, OUTSIDE.replace("offered=", "needs=('nothing',), offered="))
    assert "counting" not in plugins.installed()
