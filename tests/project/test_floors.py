"""Rooms lie on floors: a room imports rooms of lower floors, and of its own floor those that FLOORS names."""

import ast
from fnmatch import fnmatch
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "spi"

#: Floors from the ground up, each with its rooms; a room may also import those rooms of its own floor that stand here.
FLOORS = [
    {"compiler": [], "numerics": ["compiler"]},
    {"ensemble": []},
    {
        "checks": [],
        "exact": [],
        "expressions": [],
        "models": ["checks"],
        "schemes": ["checks"],
        "statistics": ["storage"],
        "storage": [],
        "systems": ["checks", "expressions"],
    },
    {"drawing": [], "printing": [], "specs": []},
    {
        "kinds": [],
        **{f"kinds.{kind}": ["kinds"] for kind in ("equilibrium", "stability", "strong", "trajectory", "weak")},
        "kinds.answer": ["kinds", "kinds.weak"],
        "kinds.work_precision": ["kinds", "kinds.strong", "kinds.weak"],
    },
    {"running": []},
    {"api": ["report"], "cli": ["report"], "report": []},
]

#: Which modules may import a package from elsewhere; what does not stand here may be imported anywhere.
THIRD_PARTY = {
    "typer": ["cli.*"],
    "yaml": ["specs.*"],
    "pydantic": ["specs.*", "kinds.*.keys"],
    "h5py": ["storage.*"],
    "sympy": ["systems.*"],
    "mpmath": ["systems.*"],
    "matplotlib": ["drawing.*", "kinds.*.figure*"],
    "rich": ["printing.*", "kinds.*.table*", "report.*", "api.*", "cli.*"],
    "jinja2": ["report.*"],
    "xarray": ["api.*"],
    "pandas": ["api.*", "printing.*", "report.*"],
    "dask": ["running.clusters"],
    "distributed": ["running.clusters"],
    "numba": ["compiler.*", "ensemble.loop", "numerics.elementary"],
    "numba.core": ["compiler.*"],
    "llvmlite": ["compiler.*", "cli.doctor"],
}


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


def room_of(module):
    """(room, number of its floor) of a module, given its dotted name within the package; None if it has none."""
    rooms = [(room, floor) for floor, rooms in enumerate(FLOORS) for room in rooms]
    return max(
        (one for one in rooms if f"{module}.".startswith(f"{one[0]}.")), key=lambda one: len(one[0]), default=None
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
            if not any(fnmatch(f"{module}.", f"{one}*") for one in THIRD_PARTY.get(what, ["*"])):
                found.append(f"{where}{what} is imported only in {', '.join(THIRD_PARTY[what])}")
            target = module_of(inner) if top == root else ""
            if target and here is None:
                found.append(f"{where}the root imports none of its modules, because it runs before each of them")
            elif target:
                there = room_of(target)
                if there[0] != here[0] and there[1] >= here[1] and there[0] not in FLOORS[here[1]][here[0]]:
                    found.append(f"{where}{here[0]} must not import {there[0]}")
    return found


def test_every_room_imports_from_lower_floors():
    assert violations(PACKAGE) == []


def test_there_are_at_most_seven_floors_and_nothing_lies_loose():
    assert len(FLOORS) <= 7
    assert [file.name for file in PACKAGE.iterdir() if file.is_file()] == ["__init__.py"]
    assert all(PACKAGE.joinpath(*room.split("."), "__init__.py").is_file() for rooms in FLOORS for room in rooms)


SOUND = {
    "__init__.py": "import os\n__version__ = '0'\n",
    "compiler/dispatch.py": "import numba\n",
    "numerics/rng.py": "from ..compiler import dispatch\nfrom . import elementary\n",
    "numerics/elementary.py": "from ..compiler.dispatch import device\n",
    "ensemble/protocol.py": "import numpy\nfrom ..numerics.rng import LANES\n",
    "models/__init__.py": "from .rigid_body import RigidBody\nfrom ..checks.registration import register_model\n",
    "models/rigid_body.py": "from ..ensemble.protocol import load\nfrom .. import __version__\n",
    "checks/registration.py": "",
    "specs/__init__.py": "def read():\n    import yaml\n    from ..models import RigidBody\n",
    "storage/results.py": "import h5py\n",
    "drawing/__init__.py": "from matplotlib import pyplot\n",
    "kinds/__init__.py": "",
    "kinds/plans.py": "from spi.ensemble.loop import grid\nfrom .state import State\n",
    "kinds/state.py": "if TYPE_CHECKING:\n    from .plans import Plan\n",
    "kinds/strong/keys.py": "import pydantic\nfrom spi.specs import read\n",
    "kinds/strong/study/__init__.py": "from spi.kinds.plans import Plan\nfrom .paths import advance\n",
    "kinds/strong/study/paths.py": "",
    "kinds/strong/table.py": "import rich\n",
    "kinds/strong/figure/__init__.py": "import matplotlib\nfrom spi.drawing import style\n",
    "kinds/weak/results.py": "",
    "kinds/work_precision/study.py": "from spi.kinds.strong import study\n",
    "running/clusters.py": "import dask.config\nfrom distributed import Client\n",
    "running/workers.py": "from spi.kinds import KINDS\n",
    "cli/__init__.py": "import typer\nfrom .. import specs\nimport spi.models.rigid_body\n",
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
        ("ensemble/protocol.py", "from ..models import RigidBody\n", "ensemble must not import models"),
        ("ensemble/protocol.py", "def f():\n    from .. import cli\n", "ensemble must not import cli"),
        ("ensemble/protocol.py", "import spi.cli\n", "ensemble must not import cli"),
        ("compiler/dispatch.py", "from ..numerics.rng import philox\n", "compiler must not import numerics"),
        (
            "models/rigid_body.py",
            "from ..checks import registration, x\nfrom ..cli import x\n",
            "models must not import cli",
        ),
        ("checks/registration.py", "from ..models import MODELS\n", "checks must not import models"),
        ("specs/__init__.py", "from ..drawing import draw\n", "specs must not import drawing"),
        ("specs/__init__.py", "from ..kinds import KINDS\n", "specs must not import kinds"),
        ("kinds/plans.py", "from .strong.study import x\n", "kinds must not import kinds.strong"),
        ("kinds/plans.py", "from spi.running.workers import x\n", "kinds must not import running"),
        ("kinds/strong/table.py", "from spi.kinds.weak.results import x\n", "kinds.strong must not import kinds.weak"),
        ("kinds/strong/study/paths.py", "from spi.running.workers import x\n", "kinds.strong must not import running"),
        ("kinds/new/keys.py", "from spi.kinds.strong.table import x\n", "kinds must not import kinds.strong"),
        ("kinds/strong/study/paths.py", "import distributed\n", "distributed is imported only in running.clusters"),
        ("kinds/strong/table.py", "from matplotlib import x\n", "matplotlib is imported only in drawing"),
        ("kinds/weak/results.py", "import rich\n", "rich is imported only in"),
        ("models/rigid_body.py", "import h5py\n", "h5py is imported only in storage"),
        ("specs/__init__.py", "import numba\n", "numba is imported only in"),
        ("__init__.py", "import numba\n", "numba is imported only in"),
        ("models/rigid_body.py", "from numba.core import cgutils\n", "numba.core is imported only in compiler"),
        ("__init__.py", "from .cli import main\n", "the root imports none"),
        ("new.py", "", "new is in no room"),
        ("new/thing.py", "", "new.thing is in no room"),
    ],
)
def test_a_violation_is_noticed(tmp_path, file, text, complaint):
    found = violations(write(tmp_path, {**SOUND, file: text}))
    assert len(found) == 1 and complaint in found[0]
