"""What the notebook and the page about Python show is run, cell by cell."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED

from spi import storage
from spi.storage.stored import Swept

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOK = DOCS / "notebook.ipynb"
MOST_BYTES = 400_000


def cells(path):
    """The code in a notebook or a page, in its order."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        return ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run(codes, where):
    """Run pieces of code one after the other, in one namespace."""
    names = {"__name__": "__main__"}
    for number, code in enumerate(codes, start=1):
        exec(compile(code, f"{where}, piece {number}", "exec"), names)
    return names


@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
@pytest.mark.parametrize("name", [pytest.param("notebook.ipynb", marks=pytest.mark.slow), "python.md"])
def test_all_code_runs(name, tmp_path, monkeypatch, capsys):
    from matplotlib import pyplot

    monkeypatch.chdir(tmp_path)
    pyplot.switch_backend("agg")
    codes = cells(DOCS / name)
    assert len(codes) > 5
    try:
        names = run(codes, name)
    finally:
        pyplot.close("all")
        pyplot.rcdefaults()
    out = capsys.readouterr().out
    assert "spec: schemes: entry 1 is 'spliting'; did you mean 'splitting'?" in out
    if name == "notebook.ipynb":
        (told,) = re.findall(r"y1 stays positive .*", out)
        assert told in "".join(map(str, stored_texts()))  # what is stored is what comes out
        assert 0 < float(names["own"].casimirs.std()) < 1e-12
    else:
        assert Path("mine.pdf").is_file() and names["loaded"].parts == names["mine"].parts


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
def test_the_examples_of_the_integrator_run(capsys):
    names = run(cells(DOCS / "integrator.md"), "integrator.md")
    assert abs(np.ptp((names["y"] ** 2).sum(axis=1))) < 1 and len(capsys.readouterr().out.splitlines()) == 13
    assert np.std(names["other"] - names["one"]) < 0.1 * np.std(names["one"])
    assert names["corrected"].var() < names["y1"].var()


def lattices(scaled_cumulant, scaled_m, Tc=1.4429, inverse=1 / 0.7112, power=0.3689 / 0.7112):
    """Results like those of `heisenberg_cubic` whose cumulant and magnetisation are functions of (T - Tc) L^inverse."""
    from long_results import equilibrium, equilibrium_group

    from spi.plugins.dynamics.kinds.equilibrium.results import DerivedQuantities

    def group(L, T):
        x = (T - Tc) * L**inverse
        value = np.full((3, 2), [scaled_cumulant(x), scaled_m(x) / L**power])
        told = {"quantities": ("binder", "magnetisation"), "formulas": ("", "")}
        derived = DerivedQuantities(**told, value=value, stderr=np.full((3, 2), 2e-3))
        swept = Swept(word="T", value=T, owner=f"cells_{L}", title=f"{L} sites")
        whole = equilibrium_group("splitting", derived, swept=swept)
        of_one = {
            name: (axes, values.take([0], axes.index("h")) if "h" in axes else values)
            for name, (axes, values) in whole.variables.items()
        }
        coordinates = whole.coordinates | {"h": whole.coordinates["h"][:1]}
        return whole._replace(case=f"cells_{L}_T={T}", variables=of_one, coordinates=coordinates)

    T = (1.3, 1.38, 1.41, 1.43, 1.4429, 1.46, 1.48, 1.52, 1.6)
    stored = equilibrium(*(group(L, value) for L in (16, 8) for value in T))
    return stored._replace(attributes=stored.attributes | {"figure_keys": json.dumps({"crossing": "binder"})})


@pytest.mark.needs("dynamics")
def test_the_program_of_finite_size_scaling(tmp_path, monkeypatch, capsys):
    """Chi squared is 0 where both sizes are on one curve and large with other exponents; from parabolas it finds nu."""
    monkeypatch.chdir(tmp_path)
    stored = lattices(lambda x: 0.62 - 0.03 * x - 2e-3 * x**2, lambda x: 1.1 - 0.2 * x)
    storage.write(Path("results/heisenberg_cubic.h5"), stored)
    names = run(cells(DOCS / "finite_size.md"), "finite_size.md")
    assert abs(names["Tc"] - 1.4429) < 1e-9 and Path("finite_size.png").is_file()
    right, *wrong, _, last = capsys.readouterr().out.splitlines()
    assert right == "nu = 0.7112: U 0.0, m 0.0" and last.startswith("nu = 0.71 +- 0.")
    assert all(min(map(float, re.findall(r"[Um] ([\d.]+)", line))) > 5 for line in wrong) and len(wrong) == 2


def stored_texts():
    """What the cells of the notebook printed when it was stored."""
    for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]:
        for output in cell.get("outputs", []):
            yield "".join(output.get("text", []))


def test_the_notebook_is_small_has_its_output_and_no_magic():
    data = NOTEBOOK.read_bytes()
    assert len(data) < MOST_BYTES
    stored = json.loads(data)
    codes = [cell for cell in stored["cells"] if cell["cell_type"] == "code"]
    assert sum(bool(cell["outputs"]) for cell in codes) >= len(codes) - 1  # all but the imports
    assert not any(line.lstrip().startswith(("%", "!")) for cell in codes for line in cell["source"])
    outputs = [output for cell in codes for output in cell["outputs"]]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 4
    assert not any(output["output_type"] == "error" for output in outputs)
    assert "/tmp/" not in data.decode() and "/home/" not in data.decode()
