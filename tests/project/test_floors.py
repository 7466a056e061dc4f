"""Rooms lie on floors: a room imports rooms of lower floors, and of its own floor those that FLOORS names.

A folder of a plug-in that is called like a room lies on its floor; what else a plug-in has is above all of them.
"""

import ast
import functools
from fnmatch import fnmatch
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "spi"

#: Floors from the ground up, each with its rooms; a room may also import those rooms of its own floor that stand here.
FLOORS = [
    {"compiler": [], "numerics": ["compiler"], "plugins": []},
    {"ensemble": []},
    {
        "checks": [],
        "exact": [],
        "expressions": [],
        "models": ["checks", "expressions"],
        "schemes": ["checks"],
        "statistics": ["storage"],
        "storage": [],
    },
    {"drawing": [], "printing": [], "specs": ["drawing"]},
    {
        "kinds": [],
        **{f"kinds.{kind}": ["kinds"] for kind in ("stability", "strong", "trajectory", "weak")},
        "kinds.answer": ["kinds", "kinds.weak"],
        "kinds.work_precision": ["kinds", "kinds.strong", "kinds.weak"],
    },
    {"running": []},
    {"api": ["views"], "cli": ["views"], "views": []},
]

#: Which modules may import a package from elsewhere; what does not stand here may be imported anywhere.
THIRD_PARTY = {
    "typer": ["cli.*", "plugins.*.command"],
    "yaml": ["specs.*"],
    "pydantic": ["specs.*", "kinds.*.keys", "plugins.spins.models.driving"],
    "h5py": ["storage.*"],
    "sympy": ["expressions.symbols", "plugins.systems.*", "plugins.lattices.*"],
    "mpmath": ["plugins.systems.*"],
    "matplotlib": ["drawing.*", "kinds.*.figure*"],
    "rich": ["printing.*", "api.*", "cli.*"],
    "jinja2": ["plugins.report.*"],
    "latex2mathml": ["plugins.report.*"],
    "xarray": ["api.*"],
    "pandas": ["api.*", "printing.*", "plugins.report.*"],
    "distributed": ["plugins.clusters.command"],
    "numba": ["compiler.*", "ensemble.loop", "plugins.spins.models.*", "numerics.elementary"],  # prange and vectors
    "numba.core": ["compiler.*"],
    "llvmlite": ["compiler.*", "cli.doctor"],
}


@functools.cache  # several tests look at the whole package
def imports(source, module, is_package):
    """(line, dotted name) of everything that a module imports, wherever in it; "from a import b" gives a.b."""
    parents, found = module.split(".") if is_package else module.split(".")[:-1], []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = parents[: len(parents) - node.level + 1] if node.level else []
            base = [*base, *([node.module] if node.module else [])]
            found += [(node.lineno, ".".join([*base, alias.name])) for alias in node.names]
    return found


def inner_of(module):
    """(plug-in, dotted name within it) of a module; without a plug-in ("", its own name)."""
    top, _, rest = module.partition(".")
    plugin, _, inner = rest.partition(".")
    return (plugin, inner) if top == "plugins" and plugin else ("", module)


def room_of(module):
    """(room, number of its floor) of a module, given its dotted name within the package; None if it has none."""
    plugin, inner = inner_of(module)
    rooms = [(room, floor) for floor, rooms in enumerate(FLOORS) for room in rooms]
    above = (f"plugins.{plugin}", len(FLOORS)) if plugin else None
    return max(
        (one for one in rooms if f"{inner}.".startswith(f"{one[0]}.")), key=lambda one: len(one[0]), default=above
    )


def violations(package):
    """What is wrong in the package in the folder `package`, one line each."""
    found, root, modules = [], package.name, {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file

    def module_of(name):
        """The module that a dotted name within the package belongs to: the longest prefix that is one."""
        while name not in modules:
            name = name.rpartition(".")[0]
        return name

    for module, file in modules.items():
        here = room_of(module)
        if module and here is None:
            found.append(f"{module} is in no room")
            continue
        text, full = file.read_text(encoding="utf-8"), f"{root}.{module}".rstrip(".")
        for line, name in imports(text, full, file.name == "__init__.py"):
            where = f"{file.relative_to(package).as_posix()}:{line}: "
            top, _, inner = name.partition(".")
            two = ".".join(name.split(".")[:2])
            what = two if two in THIRD_PARTY else top
            names = f"{module}.", f"{inner_of(module)[1]}."
            if not any(fnmatch(name, f"{one}*") for one in THIRD_PARTY.get(what, ["*"]) for name in names):
                found.append(f"{where}{what} is imported only in {', '.join(THIRD_PARTY[what])}")
            target = module_of(inner) if top == root else ""
            if target and here is None:
                found.append(f"{where}the root imports none of its modules, because it runs before each of them")
            elif target:
                there = room_of(target)
                allowed = FLOORS[here[1]][here[0]] if here[1] < len(FLOORS) else [there[0]]  # see tests/plugins
                if there[0] != here[0] and there[1] >= here[1] and there[0] not in allowed:
                    found.append(f"{where}{here[0]} must not import {there[0]}")
    return found


def test_every_room_imports_from_lower_floors():
    assert violations(PACKAGE) == []


@pytest.mark.needs
def test_there_are_at_most_seven_floors_and_nothing_lies_loose():
    assert len(FLOORS) <= 7
    assert [file.name for file in PACKAGE.iterdir() if file.is_file()] == ["__init__.py"]
    tops = [PACKAGE, *(path for path in PACKAGE.glob("plugins/*") if path.is_dir())]
    for room in (room for rooms in FLOORS for room in rooms):
        assert any(top.joinpath(*room.split("."), "__init__.py").is_file() for top in tops), room


def test_an_import_from_above_and_one_from_elsewhere_are_noticed(tmp_path):
    package = tmp_path / "spi"
    package.joinpath("models").mkdir(parents=True)
    package.joinpath("cli").mkdir()
    package.joinpath("__init__.py").touch()
    package.joinpath("cli", "__init__.py").touch()
    package.joinpath("models", "__init__.py").write_text("def f():\n    from ..cli import main\n    import h5py\n")
    assert violations(package) == [
        "models/__init__.py:2: models must not import cli",
        "models/__init__.py:3: h5py is imported only in storage.*",
    ]
