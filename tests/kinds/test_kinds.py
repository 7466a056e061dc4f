"""What a kind of experiment consists of, and that a further one is a folder and a line."""

import inspect
import io
import shutil
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from spi import storage
from spi.kinds import KINDS, FigureModule, Kind, ResultsModule, StudyModule, TableModule
from spi.report import views
from spi.running import run as runs
from spi.storage.stored import Stored

SPEC = """\
kind: energy
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: [2^-2, 2^-3]
reference_step: 2^-4
schemes: [splitting]
samples: 70
"""


@pytest.fixture
def energy(monkeypatch):
    """The kind of tests/energy_kind, registered as one of the program's own."""
    monkeypatch.setitem(KINDS, "energy", Kind("energy_kind"))
    runs.layers.cache_clear()
    yield
    runs.layers.cache_clear()


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_has_all_of_its_modules(name):
    kind = KINDS[name]
    assert kind.keys.Case.__doc__
    assert callable(kind.study.parts) and callable(kind.study.plan)
    assert issubclass(kind.results.Record, Stored)
    assert kind.keys.Case.quantities and callable(kind.results.quantities)
    assert callable(kind.table.rows) and callable(kind.table.show)
    assert callable(kind.figure.draw)
    with pytest.raises(AttributeError, match="no module 'plots', only keys, study"):
        _ = kind.plots


CONTRACT = {"study": StudyModule, "table": TableModule, "figure": FigureModule}


CLAIMED = CONTRACT | {"results": ResultsModule}  #: of a kind whose keys name quantities


def breaches(kind):
    """What modules of a kind do not take as the contract says, and those that do not take the kind's readings."""
    found = []
    for role, contract in (CLAIMED if kind.keys.Case.quantities else CONTRACT).items():
        module = getattr(kind, role)
        for name, promised in vars(contract).items():
            if inspect.isfunction(promised) and not name.startswith("_"):
                _, *expected = inspect.signature(promised).parameters
                if list(inspect.signature(getattr(module, name)).parameters) != expected:
                    found.append(f"{role}.{name} must take {', '.join(expected)}")
    record = kind.results.Record
    taken = {
        "table.rows": get_args(kind.table.rows.__annotations__.get("readings")),
        "table.show": get_args(kind.table.show.__annotations__.get("readings")),
    }
    if kind.keys.Case.quantities:
        taken["results.quantities"] = get_args(kind.results.quantities.__annotations__.get("readings"))
    panels = [panel for each in kind.figure.draw.panels.values() for panel in each if hasattr(panel, "field")]
    fields = {field.name for field in record.described}
    found += [f"figure: {panel.field} is no field" for panel in panels if panel.field.split(".")[0] not in fields]
    return found + [f"{name} does not take the kind's readings" for name, types in taken.items() if types != (record,)]


@pytest.mark.parametrize("name", [*KINDS, "energy"])
def test_every_kind_keeps_the_contract(name, energy):
    assert breaches(KINDS[name]) == []


def test_a_breach_of_the_contract_is_noticed():
    strong, weak = KINDS["strong"], KINDS["weak"]

    def rows(results: Iterable[int]): ...

    table = SimpleNamespace(rows=rows, show=weak.table.show)
    modules = {name: getattr(strong, name) for name in ("keys", "study", "results", "figure")}
    other = SimpleNamespace(**modules, table=table)
    foreign = [f"{name} does not take the kind's readings" for name in ("table.rows", "table.show")]
    assert breaches(other) == ["table.rows must take readings", *foreign]


def test_a_further_kind_is_a_folder_and_a_line(energy, tmp_path):
    spec = tmp_path / "energy.yaml"
    spec.write_text(SPEC, encoding="utf-8")
    experiment = runs.load(spec)
    assert runs.cost(experiment).path_steps == 70 * (4 + 8 + 16)
    results = storage.read(runs.run(experiment, tmp_path))
    (reading,) = views.readings(results)
    # H is between the extreme values on the sphere |y| = 1, and differs from path to path
    assert ((reading.energy > 0.25) & (reading.energy < 0.75)).all() and (reading.energy_stderr > 0).all()
    np.testing.assert_array_equal(reading.h, [2**-2, 2**-3])
    assert views.rows(results)[1]["energy"] == reading.energy[1]
    views.print_tables(results, text := io.StringIO())
    assert "splitting" in text.getvalue() and "±" in text.getvalue()
    for file in views.save(views.figure(results), tmp_path, "energy"):
        assert file.stat().st_size > 1000


def test_a_kind_without_quantities_says_so(energy, tmp_path):
    spec = tmp_path / "energy.yaml"
    spec.write_text(SPEC + "expect:\n  splitting: {order: 1}\n", encoding="utf-8")
    with pytest.raises(
        Exception, match=r"energy.yaml:9: expect: is not possible for this kind of experiment, which has"
    ):
        runs.load(spec)


def test_the_further_kind_is_not_known_without_its_line(tmp_path):
    spec = tmp_path / "energy.yaml"
    spec.write_text(SPEC, encoding="utf-8")
    with pytest.raises(Exception, match="is 'energy'; known: strong"):
        runs.load(spec)


def test_the_example_keeps_the_rules_of_the_floors(tmp_path):
    from test_floors import violations

    package = tmp_path / "spi"
    shutil.copytree(Path(__file__).parents[2] / "spi", package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(Path(__file__).parents[1] / "energy_kind", package / "kinds" / "energy")
    assert violations(package) == []
