"""A module imports only from lower floors, and some packages have one module each that may import them."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "spi"

# On floors 0 and 1 a later module may import an earlier one; higher up no module imports another of its floor.
FLOORS = [
    [
        "own",
        "modules",
        "inlining",
        "dispatch",
        "vectors",
        "elementary",
        "rng",
        "arithmetic",
        "records",
        "tallies",
        "claims",
        "richardson",
    ],
    [
        "angles",
        "protocol",
        "lanes",
        "registration",
        "invariants",
        "fields",
        "areas",
        "increments",
        "steppers",
        "compilable",
        "differences",
        "model_checks",
    ],
    ["models", "schemes", "systems", "expressions", "ensemble", "kolmogorov", "estimators", "sphere_law"],
    ["spec", "storage", "drawing", "printing", "compiling", "shipped"],
    ["kinds"],
    ["loading"],
    ["workers"],
    ["engine"],
    ["checkpoint"],
    ["session"],
    ["runs", "slices", "views", "verification"],
    ["report", "doctor"],
    ["api"],
    ["cli"],
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names}
ORDERED = FLOORS[0] + FLOORS[1]

# Packages that are one module in several files; the members of the others (models) are strangers.
_PARTS = [
    "expressions",
    "systems",
    "kolmogorov",
    "schemes",
    "spec",
    "storage",
    "drawing",
    "printing",
    "report",
    "api",
    "cli",
]
ONE_THING = [*_PARTS, "models.zeitlin"]

#: Members of a package of strangers that know others of it: fields are those of every model on the lattice.
KNOWS = {"models.zeitlin.fields": ["models.zeitlin", "models.sine_euler", "models.damped"]}

#: What each module of a kind of experiment may import of floor 3, and of its own kind.
ROLES = {
    "keys": (["spec"], []),
    "study": ([], []),
    "reading": ([], []),
    "claims": ([], ["reading"]),
    "table": (["printing"], ["reading"]),
    "figure": (["drawing"], ["reading"]),
}
#: What the studies of all kinds share, modules of the package of kinds that may import one another.
SHARED = ["plans", "state", "blocks"]

#: A kind whose study and reading build on those of others.
BUILDS_ON = {"work_precision": ["strong", "weak"]}

_LOWEST = [name for names in FLOORS[:3] for name in names]
ONLY_IN = {
    "typer": ["cli"],
    "yaml": ["spec"],
    "pydantic": ["spec", "keys"],
    "h5py": ["storage"],
    "sympy": ["systems"],
    "mpmath": ["systems"],
    "matplotlib": ["drawing", "figure"],
    "rich": ["printing", "table", "report", "api", "cli"],
    "jinja2": ["report"],
    "xarray": ["api"],
    "pandas": ["api"],
    "dask": ["workers"],
    "distributed": ["workers"],
    "numba": _LOWEST,
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

    def shared(*names):
        return {tuple(name.split(".")) for name in names} <= {(root, "kinds", one) for one in SHARED}

    for module, (file, is_package) in modules.items():
        own = [*module.split("."), None][1]  # the name that has a floor; None for the root, which lies below all
        kind, role = [*module.split(".")[2:4], None, None][:2] if own == "kinds" else (None, None)
        if own is not None and own not in FLOOR:
            found.append(f"{module} has no floor")
            continue
        if role is not None and role not in ROLES:
            found.append(f"{module} is none of {', '.join(ROLES)}")
            continue
        for line, name in imports(file.read_text(encoding="utf-8"), module, is_package):
            where = f"{file.relative_to(package)}:{line}: "
            top = name.split(".")[0]
            if top in ONLY_IN and (role or own) not in ONLY_IN[top]:
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
            elif role is not None and FLOOR[other] >= FLOOR["spec"]:
                found += [f"{where}{reason}" for reason in wrong_in_a_kind(kind, role, target.split(".")[1:])]
            elif own == other and (is_package or one_thing(module, target)) and target != root + "." + own:
                pass  # a package's __init__ gathers its members
            elif shared(module, target) or target.removeprefix(f"{root}.") in KNOWS.get(
                module.removeprefix(f"{root}."), []
            ):
                pass
            elif FLOOR[other] >= FLOOR[own]:
                found.append(f"{where}{own} (floor {FLOOR[own]}) must not import {other} (floor {FLOOR[other]})")
    return found


def wrong_in_a_kind(kind, role, target):
    """What is wrong, if anything, with the import of `target`, on floor 3 or above, in one module of a kind."""
    tools, siblings = ROLES[role]
    if target[0] != "kinds":
        if target[0] not in tools:
            yield f"{role} of a kind must not import {target[0]}"
    elif len(target) <= 2:  # what all kinds share
        if target[1:] not in [[name] for name in SHARED] or role != "study":
            yield f"{role} of a kind must not import {'.'.join(target)}"
    elif target[1] != kind:
        if target[1] not in BUILDS_ON.get(kind, []) or role != target[2]:
            yield f"{role} of kind {kind} must not import kind {target[1]}"
    elif target[2] not in (role, *siblings):
        yield f"{role} of a kind must not import its {target[2]}"


def test_every_module_imports_from_lower_floors():
    assert PACKAGE.is_dir()
    assert violations(PACKAGE) == []


SOUND = {
    "__init__.py": "import os\n__version__ = '0'\n",
    "dispatch.py": "import numba\n",
    "records.py": "import numpy\n",
    "elementary.py": "from .dispatch import inlined\n",
    "rng.py": "from . import dispatch, elementary\n",
    "tallies.py": "from .rng import LANES\n",
    "protocol.py": "import numpy\nfrom .rng import LANES\n",
    "fields.py": "from .protocol import load\n",
    "models/__init__.py": "from .rigid_body import RigidBody\nfrom . import rigid_body\n",
    "models/rigid_body.py": "from ..protocol import load\nfrom .. import __version__\n",
    "ensemble.py": "from .protocol import load\n",
    "spec.py": "def read():\n    import yaml\n    from .models import RigidBody\n",
    "storage/__init__.py": "from .results import read\n",
    "storage/results.py": "import h5py\n",
    "drawing.py": "from matplotlib import pyplot\n",
    "printing.py": "import rich\n",
    "kinds/__init__.py": "",
    "kinds/plans.py": "from spi.ensemble import grid\nfrom .state import State\n",
    "kinds/state.py": "from spi.tallies import Tally\nif TYPE_CHECKING:\n    from .plans import Plan\n",
    "kinds/blocks.py": "from .plans import Plan\n",
    "kinds/strong/keys.py": "import pydantic\nfrom spi.spec import read\n",
    "kinds/strong/study/__init__.py": "from spi.kinds.plans import Plan\nfrom .paths import advance\n",
    "kinds/strong/study/paths.py": "from spi.ensemble import grid\nfrom spi.kinds.blocks import BlocksPlan\n",
    "kinds/strong/reading.py": "from spi.records import Group\n",
    "kinds/strong/table.py": "import rich\nfrom spi.printing import text\nfrom .reading import read\n",
    "kinds/strong/figure.py": "import matplotlib\nfrom spi.drawing import style\n",
    "kinds/weak/reading.py": "",
    "kinds/work_precision/study.py": "from spi.kinds.strong import study\n",
    "loading.py": "from . import spec\nfrom .kinds import KINDS\n",
    "workers.py": "import dask.config\nfrom distributed import Client\nfrom .loading import plans\n",
    "engine.py": "from .kinds.state import State\nfrom .workers import Workers\nfrom .loading import Source\n",
    "checkpoint.py": "from . import storage\nfrom .kinds.state import State\nfrom .loading import plans\n",
    "runs.py": "from . import checkpoint, engine, storage, spec\nfrom .kinds import KINDS\n",
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
        ("spec.py", "from .drawing import draw\n", "spec (floor 3) must not import drawing (floor 3)"),
        ("spec.py", "from .kinds import KINDS\n", "spec (floor 3) must not import kinds (floor 4)"),
        ("kinds/strong/study/paths.py", "from spi.runs import run\n", "study of a kind must not import run"),
        ("kinds/strong/study/paths.py", "from spi.storage import read\n", "study of a kind must not import storage"),
        ("kinds/strong/study/paths.py", "from spi.engine import x\n", "study of a kind must not import engine"),
        ("kinds/strong/keys.py", "from spi.kinds.state import State\n", "keys of a kind must not import kinds.state"),
        ("kinds/strong/figure.py", "from spi.kinds.blocks import x\n", "figure of a kind must not import kinds.blocks"),
        ("kinds/strong/study/paths.py", "from spi.kinds import KINDS\n", "study of a kind must not import kinds"),
        ("kinds/state.py", "from .strong.study import x\n", "kinds (floor 4) must not import kinds (floor 4)"),
        ("kinds/plans.py", "from . import KINDS\n", "kinds (floor 4) must not import kinds (floor 4)"),
        ("kinds/blocks.py", "from spi.loading import plans\n", "kinds (floor 4) must not import loading (floor 5)"),
        ("loading.py", "from .workers import Workers\n", "loading (floor 5) must not import workers (floor 6)"),
        ("workers.py", "from .engine import x\n", "workers (floor 6) must not import engine (floor 7)"),
        ("engine.py", "from .checkpoint import x\n", "engine (floor 7) must not import checkpoint (floor 8)"),
        ("checkpoint.py", "from .runs import run\n", "checkpoint (floor 8) must not import runs (floor 10)"),
        ("engine.py", "import distributed\n", "distributed is imported only in workers"),
        ("kinds/strong/study/paths.py", "from ..reading import read\n", "study of a kind must not import its reading"),
        ("kinds/strong/reading.py", "from spi.drawing import x\n", "reading of a kind must not import drawing"),
        ("kinds/strong/reading.py", "import rich\n", "rich is imported only in"),
        ("kinds/strong/table.py", "from matplotlib import x\n", "matplotlib is imported only in"),
        ("kinds/strong/figure.py", "from .table import rows\n", "figure of a kind must not import its table"),
        ("kinds/strong/figure.py", "from spi.kinds import KINDS\n", "figure of a kind must not import kinds"),
        ("kinds/strong/reading.py", "from spi.kinds.weak.reading import x\n", "must not import kind weak"),
        (
            "kinds/weak/study.py",
            "from spi.kinds.strong import study\n",
            "study of kind weak must not import kind strong",
        ),
        ("kinds/work_precision/study.py", "from spi.kinds.strong.table import x\n", "must not import kind strong"),
        ("kinds/strong/new.py", "", "spi.kinds.strong.new is none of keys, study"),
        ("elementary.py", "from .rng import philox\n", "comes after it"),
        ("rng.py", "from .tallies import Chunk\n", "rng must not import tallies, which comes after it"),
        ("tallies.py", "from .protocol import x\n", "tallies must not import protocol, which comes after it"),
        ("tallies.py", "from .ensemble import grid\n", "tallies (floor 0) must not import ensemble (floor 2)"),
        ("elementary.py", "from .protocol import load\n", "must not import protocol, which comes after it"),
        ("protocol.py", "from .fields import drift_field\n", "must not import fields, which comes after it"),
        ("fields.py", "from .models import RigidBody\n", "fields (floor 1) must not import models (floor 2)"),
        ("__init__.py", "from .cli import main\n", "the root imports none"),
        ("models/rigid_body.py", "import h5py\n", "h5py is imported only in storage"),
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
