"""Kernels are found in the disk cache, and never stale."""

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import compiled_only
from own_models import OSCILLATOR

import spi
from spi.compiler import caching

#: A small kernel that asks a model.
ENERGY_KERNEL = """
from spi.compiler.dispatch import kernel
from spi.ensemble.protocol import hamiltonian

@kernel
def energy(model, y):
    return hamiltonian(model, y)
"""
ENERGY = """
import numpy as np
import spi.models
from energies import energy as kernel
from spi.ensemble.protocol import dimension
model = {}
states = np.array(kernel(model, tuple(1.0 + np.arange(dimension(model)))))
"""
REPORT = """
import json, sys
import spi
count = lambda counter: sum(counter.values())
json.dump(
    {
        "package": spi.__file__,
        "states": states.ravel().tolist(),
        "hits": count(kernel.stats.cache_hits),
        "misses": count(kernel.stats.cache_misses),
    },
    sys.stdout,
)
"""


def run(folder, program):
    """Run a program, and REPORT after it, in a new process with the package that lies in `folder`."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "SPI_CACHE_DIR": str(folder / "cache")}
    answer = subprocess.run(
        [sys.executable, "-c", program + REPORT],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert answer.returncode == 0, answer.stderr
    found = json.loads(answer.stdout)
    assert Path(found["package"]).parent == folder / "spi"  # the copy, not the original
    return found


#: Edits of the package, (file, text, what takes its place): those after which nothing is compiled again, and one.
EDITS = {
    False: (  # a label, a docstring, an estimator, the reading of specs
        ("schemes/table.py", 'label="splitting"', 'label="Lie-Trotter"'),
        ("kinds/strong/results.py", '"""Record of strong errors."""', '"""Strong errors, stored."""'),
        ("statistics/rounding.py", "\nMULTIPLE = 8.0", "\nMULTIPLE = 9.0"),
        ("specs/cases.py", '"""', '"""Edited: '),
    ),
    True: (("models/rigid_body.py", "return 0.5 * (y[0] * y[0] / i[0]", "return 1.5 * (y[0] * y[0] / i[0]"),),  # a flow
}


@compiled_only
def test_kernels_are_found_in_the_cache_and_never_stale(tmp_path):
    """One story, since every first run costs a compilation: cold, warm, and after edits of other files."""
    shutil.copytree(Path(spi.__file__).parent, tmp_path / "spi", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "energies.py").write_text(ENERGY_KERNEL)
    program = ENERGY.format("spi.models.RigidBody((2.0, 1.0, 0.5), (1.0, 2.0, 3.0))")
    cold = run(tmp_path, program)
    assert (cold["hits"], cold["misses"]) == (0, 1)
    warm = run(tmp_path, program)
    assert (warm["hits"], warm["misses"]) == (1, 0)
    assert warm["states"] == cold["states"]
    for compiles, edits in EDITS.items():
        for file, old, new in edits:
            edited = tmp_path / "spi" / file
            source = edited.read_text(encoding="utf-8")
            assert old in source, f"{file} has changed: choose another edit for this test"
            edited.write_text(source.replace(old, new, 1), encoding="utf-8")
        after = run(tmp_path, program)
        assert (after["hits"], after["misses"]) == ((0, 1) if compiles else (1, 0))
        # Numba itself would not notice the edit of the model: the kernel lies in another file.
        assert (np.abs(np.subtract(after["states"], cold["states"])).max() > 0.1) == compiles
    assert len([folder for folder in (tmp_path / "cache").iterdir() if folder.name != "modules"]) == 2


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage", [lambda data: b"", lambda data: bytes(len(data)), lambda data: data[:40] + b"x" + data[41:]]
)
def test_a_damaged_file_of_the_cache_counts_as_missing(tmp_path, ending, damage):
    """Else a flipped bit would end every run with a traceback, or be executed."""
    files = caching._WithDigest(str(tmp_path), "kernel", "stamp")
    for _ in range(2):
        assert files.load("key") is None
        files.save("key", list(range(20)))
        assert files.load("key") == list(range(20))
        (file,) = tmp_path.glob(f"*.{ending}")
        file.write_bytes(damage(file.read_bytes()))


def test_a_cache_that_cannot_be_written_is_told_once_and_stops_nothing(tmp_path, monkeypatch, capsys):
    def full(*_):
        raise OSError(errno.ENOSPC, "as the system says it")

    monkeypatch.setattr(caching.FunctionCache, "save_overload", full)
    monkeypatch.setattr(caching.SharedCache, "_warned", False)
    cache = caching.SharedCache(run)
    cache._cache_path = str(tmp_path)
    for _ in range(2):
        cache.save_overload((), None)
    assert (
        capsys.readouterr().err
        == f"spi: {spi.kernels_folder()}: no space left on device; compiled kernels cannot be saved\n"
    )


@pytest.mark.slow
@compiled_only
def test_models_from_elsewhere_are_never_stale_and_leave_nothing_that_others_need(tmp_path):
    """An edit of their file is noticed, and a built-in model runs after the file is gone."""
    (tmp_path / "spi").symlink_to(Path(spi.__file__).parent)
    (tmp_path / "energies.py").write_text(ENERGY_KERNEL)
    file, edited = tmp_path / "my_model.py", OSCILLATOR.replace("return 0.5 * (y[0]", "return 1.5 * (y[0]")
    assert edited != OSCILLATOR
    by_name = "import my_model as module"
    reading = "from pathlib import Path; from spi.compiler.modules import stored; "
    from_text = reading + "module = stored('it', Path('{}').read_text())"

    def outcome(imported="", model="spi.models.MaxwellBloch((1.0, 1.0))"):
        found = run(tmp_path, f"{imported}\n{ENERGY.format(model)}")
        return (found["hits"], found["misses"]), found["states"]

    file.write_text(OSCILLATOR)
    mine = "module.Oscillator((1.0,))"
    first, states = outcome(by_name, mine)
    again, same_states = outcome(by_name, mine)
    assert (first, again) == ((0, 1), (1, 0)) and same_states == states
    file.write_text(edited)
    after, edited_states = outcome(by_name, mine)
    assert after == (0, 1) and np.abs(np.subtract(edited_states, states)).max() > 0.1

    stored = [outcome(from_text.format(file.name), mine) for _ in range(2)]
    assert stored == [((0, 1), edited_states), ((1, 0), edited_states)]
    file.unlink()
    shutil.rmtree(tmp_path / "cache" / "modules")
    assert [outcome()[0] for _ in range(2)] == [(0, 1), (1, 0)]


#: Two models whose records are called alike, and a kernel that asks them.
TWIN = """from typing import NamedTuple

class Twin(NamedTuple):
    weight: float

    def hamiltonian(model, y):
        return {}model.weight
"""
TWINS = f"""
import sys
from spi.compiler.dispatch import kernel
from spi.compiler.modules import stored

asking = "from spi.compiler.dispatch import kernel\\nfrom spi.ensemble.protocol import hamiltonian\\n"
ask = stored("asking", asking + "@kernel\\ndef ask(record):\\n    return hamiltonian(record, 0.0)\\n").ask
print(*(ask(stored("twin", {TWIN!r}.format(sign)).Twin(1.0)) for sign in sys.argv[1:]))
"""


@pytest.mark.slow
@compiled_only
def test_records_of_one_name_from_two_modules_are_not_taken_for_each_other(tmp_path):
    """Neither if one process compiles for both, nor if it finds in the cache what two others have compiled."""

    def answers(*signs, cache):
        environment = {**os.environ, "SPI_CACHE_DIR": str(tmp_path / cache)}
        command = [sys.executable, "-c", TWINS, *signs]
        answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
        return [float(number) for number in answer.stdout.split()]

    assert answers("+", "-", cache="one") == [1.0, -1.0]
    assert [answers("+", cache="two"), answers("-", cache="two")] == [[1.0], [-1.0]]
    assert answers("+", "-", cache="two") == [1.0, -1.0]
