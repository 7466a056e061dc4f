"""The rules of plug-ins: the core knows none of them, each can be left out, and one may come from elsewhere."""

import ast
import importlib
import json
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import left_out
import pytest
from test_floors import PACKAGE, imports
from without_plugins import copied

from spi import plugins

FOLDER = PACKAGE / "plugins"
NAMES = sorted(path.parent.name for path in FOLDER.glob("*/plugin.py"))

#: Words of each plug-in, as regular expressions, that stand nowhere in ``spi/`` but in its own folder and in those of
#: plug-ins that need it.
WORDS = {
    "lattices": [r"\bspins_of\b", "uniaxial anisotropy of all spins"],
    "systems": ["written in yaml", "custom system", "definitionerror", "__system__", r"['\"]bracket['\"]"],
    "fluids": ["zeitlin", "vorticit", "enstroph"],
    "spins": [r"\bspins?\b", "magnon"],
    "comparisons": ["work.precision", "workplan", r"kinds?\.stability", "stability", "regimes"],
    "dynamics": [
        "lyapunov",
        "pull-?back",
        r"\bequilibri",
        "uniform_on_surface",
        r"\bgibbs\b(?! law)",
        r"['\"](growth|quantile)['\"]",
    ],
    "drivers": ["ornstein_uhlenbeck", "fractional", "hurst", "davies"],
    "answers": ["load_answer", r"kinds?\.answer", '"answer"', "spi answer"],
    "clusters": ["dask", "spi merge", "--shard", "run_shard", "verification"],
    "solve": ["kolmogorov", "harmonics_up_to", r"cylinder\b", r"exact\.(sphere|cylinder)\b"],
    "study": ["spi study", "study_of"],
    "report": [r"page\.html", "jinja", "latex2mathml"],
}

#: Offences of today, (file, word), which only become fewer.
ALLOWED: set[tuple[str, str]] = {
    ("plugins/dynamics/kinds/statistics/keys.py", r"\bspins?\b"),  # the key of time_correlations for lattices
    ("plugins/dynamics/kinds/statistics/stationary.py", r"\bspins?\b"),
    ("plugins/dynamics/kinds/statistics/study.py", r"\bspins?\b"),
}


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


TESTS = Path(__file__).parents[1]
#: Files of tests outside tests/plugins that import a plug-in when they are imported themselves: this only gets shorter.
AT_TOP = {"yaml_cases.py"}


def test_tests_import_plugins_within_functions():
    """Else a file of tests of the core is skipped as a whole where one is left out, with all that it says of the core;
    and modules of tests of a plug-in, which leave with it, are those of this plug-in and of plug-ins that need it."""
    of_plugins = {file.stem: file.parent.name for file in TESTS.glob("plugins/*/*.py")}
    found = set()
    for file in TESTS.rglob("*.py"):
        here = file.parent.name if file.parent.parent.name == "plugins" else None
        may = {here, *(plugins.installed()[here].needs if here else ())}
        for line in ast.parse(file.read_text(encoding="utf-8")).body:
            inside = f"{line.module}." if isinstance(line, ast.ImportFrom) else ""
            for name in (f"{inside}{one.name}" for one in getattr(line, "names", ())):
                there = of_plugins.get(first := name.split(".")[0]) or (None if here else plugin_of(name))
                if there not in (None, *may) or (not here and f"{first}.py" in AT_TOP):
                    found.add(file.relative_to(TESTS).as_posix())
    assert found <= AT_TOP and (found == AT_TOP or left_out.names())


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
    program = runpy.run_path(str(PACKAGE.parent / "docs" / "generate" / "plugins.py"))
    index = json.loads((FOLDER / plugins.INDEX).read_text(encoding="utf-8"))
    gone = left_out.names()  # of a copy, see tests/without_plugins.py
    here = {field: {name: owner for name, owner in of.items() if owner not in gone} for field, of in index.items()}
    assert {field: of for field, of in here.items() if of} == program["index"]()


@pytest.mark.parametrize(
    "field", [field for field in plugins.Plugin._fields if field not in ("name", "needs", "groups", "in_python")]
)
def test_all_that_is_offered_is_there(field):
    importlib.import_module("spi.cli")  # which imports commands, and they import it
    for name, place in plugins.offers(field).items():
        if ":" not in place:  # kinds and solvers are modules
            importlib.import_module(place)
            continue
        thing = plugins.imported(place)
        if isinstance(thing, type):  # so that its name is known of the class alone, see Registry.name_of
            assert f"{thing.__module__}:{thing.__qualname__}" == place, name


def copy_without(names, tmp_path):
    """A copy of the package without some plug-ins, and the environment of programs that use it."""
    copied(("spi", "experiments"), names, tmp_path)
    return os.environ | {"PYTHONPATH": str(tmp_path)}


def answer_of(environment, folder, *arguments):
    """The outcome of `spi` with these arguments."""
    program = [sys.executable, "-c", "from spi.cli import main; main()", *arguments]
    return subprocess.run(program, cwd=folder, env=environment, capture_output=True, text=True)


def test_without_a_plugin_the_others_answer_and_its_names_are_explained(tmp_path):
    environment = copy_without(NAMES, tmp_path)
    answer = answer_of(environment, tmp_path, "--help")
    assert answer.returncode == 0 and " run " in answer.stdout and " report " not in answer.stdout
    kinds = json.loads((FOLDER / plugins.INDEX).read_text(encoding="utf-8")).get("kinds", {})
    for kind, plugin in list(kinds.items())[:1]:
        (tmp_path / "s.yaml").write_text(f"kind: {kind}\n", encoding="utf-8")
        answer = answer_of(environment, tmp_path, "check", "s.yaml")
        assert answer.returncode == 2
        assert answer.stderr == f"spi: s.yaml:1: kind: is '{kind}'; install the plug-in {plugin}, which has it\n"
    answer = answer_of(environment, tmp_path, "merge", "s.yaml")
    assert answer.stderr == "spi: No such command 'merge'; install the plug-in clusters, which has it\n"
    for *command, option, plugin in [("run", "s", "--shard=1/2", "clusters"), ("new", "s", "--system", "systems")]:
        answer = answer_of(environment, tmp_path, *command, option)
        option = option.partition("=")[0]
        assert answer.returncode == 2
        assert answer.stderr == f"spi: No such option: {option}; install the plug-in {plugin}, which has it\n"
    offered = json.loads((FOLDER / plugins.INDEX).read_text(encoding="utf-8"))["offered"]
    for name, plugin in offered.items():
        program = [sys.executable, "-c", f"import spi; spi.{name}"]
        answer = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, text=True)
        message = f"module 'spi' has no attribute '{name}'; install the plug-in {plugin}, which has it"
        assert answer.stderr.splitlines()[-1] == f"AttributeError: {message}"


@pytest.mark.slow
def test_the_rigid_body_needs_no_plugin(tmp_path):
    answer = answer_of(copy_without(NAMES, tmp_path), tmp_path, "run", "rigid_body_strong", "--profile", "quick")
    assert answer.returncode == 0, answer.stderr


def test_help_imports_no_more_of_a_plugin_than_its_commands():
    program = "import sys, spi.cli; print(*[name for name in sys.modules if name.startswith('spi.plugins.')])"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    for name in answer.stdout.split():
        assert name.count(".") == 2 or name.rpartition(".")[2] in ("plugin", "command"), name
