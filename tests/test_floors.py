"""A module imports only from lower floors, and some packages have one module each that may import them."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "spi"

# On floors 0 and 1 a later module may import an earlier one; higher up no module imports another of its floor.
FLOORS = [
    ["dispatch", "elementary", "rng", "numbers"],
    ["lanes", "protocol", "fields"],
    ["models", "schemes", "expressions", "ensemble", "kolmogorov", "estimators", "records"] + ["regimes", "sphere_law"],
    ["studies", "spec", "store", "tables", "plot", "workers"],
    ["run"],
    ["cli"],
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names}
ORDERED = FLOORS[0] + FLOORS[1]

# Packages that are one module in several files; the members of the others (models, schemes, studies) are strangers.
ONE_THING = ["expressions", "kolmogorov", "schemes", "spec", "plot", "tables", "studies.weak", "studies.stability"]

#: A member that builds on others of its package.
BUILDS_ON = {"studies.work_precision": ["studies.strong", "studies.weak"]}

ONLY_IN = {"typer": ["cli"], "yaml": ["spec"], "pydantic": ["spec"], "h5py": ["store"], "matplotlib": ["plot"]}
ONLY_IN["numba"] = FLOORS[0] + FLOORS[1] + FLOORS[2]


def imports(source, module, is_package):
    """(line, dotted name) of everything that a module imports, wherever in it; "from a import b" gives a.b."""
    parents = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = parents[: len(parents) - node.level + 1] if node.level else []
            for alias in node.names:
                yield node.lineno, ".".join([*base, *([node.module] if node.module else []), alias.name])


def violations(package):
    """What is wrong in the package in the folder `package`, one line each."""
    found, root = [], package.name
    modules = {}
    for file in sorted(package.rglob("*.py")):
        parts = [root, *file.relative_to(package).with_suffix("").parts]
        is_package = parts[-1] == "__init__"
        modules[".".join(parts[:-1] if is_package else parts)] = file, is_package

    def known(name):
        """The module that a dotted name belongs to: the longest prefix that is one."""
        while name not in modules and "." in name:
            name = name.rpartition(".")[0]
        return name

    def one_thing(*names):
        return any(all(name.startswith(f"{root}.{thing}.") for name in names) for thing in ONE_THING)

    def builds_on(name, other):
        return other.removeprefix(f"{root}.") in BUILDS_ON.get(name.removeprefix(f"{root}."), [])

    for module, (file, is_package) in modules.items():
        own = [*module.split("."), None][1]  # the name that has a floor; None for the root, which lies below all
        if own is not None and own not in FLOOR:
            found.append(f"{module} has no floor")
            continue
        for line, name in imports(file.read_text(encoding="utf-8"), module, is_package):
            where = f"{file.relative_to(package)}:{line}: "
            top = name.split(".")[0]
            if top in ONLY_IN and own not in ONLY_IN[top]:
                found.append(f"{where}{top} is imported only in {', '.join(ONLY_IN[top])}")
            if top != root or known(name) == root:
                continue
            target = known(name)
            other = target.split(".")[1]
            if own is None:
                found.append(f"{where}the root imports none of its modules, because it runs before each of them")
            elif other not in FLOOR:
                found.append(f"{where}{other} has no floor")
            elif own in ORDERED and other in ORDERED:
                if ORDERED.index(other) >= ORDERED.index(own):
                    found.append(f"{where}{own} must not import {other}, which comes after it")
            elif (
                own == other
                and (is_package or one_thing(module, target) or builds_on(module, target))
                and target != root + "." + own
            ):
                pass  # a package's __init__ gathers its members
            elif FLOOR[other] >= FLOOR[own]:
                found.append(f"{where}{own} (floor {FLOOR[own]}) must not import {other} (floor {FLOOR[other]})")
    return found


def test_every_module_imports_from_lower_floors():
    assert PACKAGE.is_dir()
    assert violations(PACKAGE) == []


SOUND = {
    "__init__.py": "import os\n__version__ = '0'\n",
    "dispatch.py": "import numba\n",
    "elementary.py": "from .dispatch import inlined\n",
    "rng.py": "from . import dispatch, elementary\n",
    "protocol.py": "import numpy\nfrom .rng import LANES\n",
    "fields.py": "from .protocol import load\n",
    "models/__init__.py": "from .rigid_body import RigidBody\nfrom . import rigid_body\n",
    "models/rigid_body.py": "from ..protocol import load\nfrom .. import __version__\n",
    "ensemble.py": "from .protocol import load\n",
    "spec.py": "def read():\n    import yaml\n    from .models import RigidBody\n",
    "plot.py": "from matplotlib import pyplot\n",
    "cli.py": "import typer\nfrom . import spec\nimport spi.models.rigid_body\n",
}


def write(folder, files):
    package = folder / "spi"
    for name, text in files.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text, encoding="utf-8")
    return package


def test_a_sound_package_passes(tmp_path):
    assert violations(write(tmp_path, SOUND)) == []


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("protocol.py", "from .models import RigidBody\n", "protocol (floor 1) must not import models (floor 2)"),
        ("protocol.py", "def f():\n    from . import cli\n", "must not import cli"),
        ("protocol.py", "import spi.cli\n", "must not import cli"),
        ("protocol.py", "from spi.models.rigid_body import RigidBody\n", "must not import models"),
        ("models/rigid_body.py", "from ..ensemble import run\n", "must not import ensemble (floor 2)"),
        ("models/rigid_body.py", "from ..spec import read\n", "must not import spec"),
        ("models/rigid_body.py", "from . import RigidBody\n", "must not import models"),
        ("models/other.py", "from .rigid_body import RigidBody\n", "must not import models"),
        ("models/__init__.py", "from ..cli import main\n", "must not import cli"),
        ("spec.py", "from .plot import draw\n", "spec (floor 3) must not import plot (floor 3)"),
        ("elementary.py", "from .rng import philox\n", "comes after it"),
        ("elementary.py", "from .protocol import load\n", "must not import protocol, which comes after it"),
        ("protocol.py", "from .fields import drift_field\n", "must not import fields, which comes after it"),
        ("fields.py", "from .models import RigidBody\n", "fields (floor 1) must not import models (floor 2)"),
        ("__init__.py", "from .cli import main\n", "the root imports none"),
        ("models/rigid_body.py", "import h5py\n", "h5py is imported only in store"),
        ("spec.py", "import numba\n", "numba is imported only in"),
        ("cli.py", "from numba.core import types\n", "numba is imported only in"),
        ("__init__.py", "import numba\n", "numba is imported only in"),
        ("new.py", "", "spi.new has no floor"),
        ("new/thing.py", "", "spi.new.thing has no floor"),
    ],
)
def test_a_violation_is_noticed(tmp_path, file, text, complaint):
    found = violations(write(tmp_path, {**SOUND, file: text}))
    assert len(found) == 1 and complaint in found[0]
