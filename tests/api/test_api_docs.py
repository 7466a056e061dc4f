"""What the notebook and the page about Python show is run, cell by cell."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED

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
