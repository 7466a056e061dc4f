"""What spi doctor says of an installation, and that it notices what is wrong with one."""

import re

import numpy as np
import pytest
from damage import call
from helpers import COMPILED

from spi.cli import doctor
from spi.cli.doctor import Finding
from spi.compiler import private
from spi.storage import Group, StorageError

NO_RUN = Finding("numbers", "as known")


@pytest.fixture
def without_run(monkeypatch):
    """The command line, but the small run finds nothing wrong and takes no time."""
    monkeypatch.setattr(doctor, "_small_run", lambda watch: [NO_RUN])
    return lambda: call("doctor")


def test_an_installation_that_works():
    code, out, err = call("doctor")
    assert code == 0
    if COMPILED:
        told = err.splitlines()
        assert told[0].startswith("spi: doctor: a small run whose numbers are known; about")
        assert all("compiling" in line for line in told[1:])
    lines = out.splitlines()
    verdicts = {line.split()[1]: line.split()[0] for line in lines}
    about = ["spi", "packages", "processor", "threads", "kernels"]
    assert list(verdicts) == about + (["numbers", "speed"] if COMPILED else ["compiler"])
    assert verdicts["spi"] == verdicts["packages"] == "ok"
    assert re.search(r"numba \d+\.\d+", lines[1])
    if COMPILED:
        assert verdicts["numbers"] == "ok"
        assert re.search(r"[\d.]+ ns a step and path; [\d.]+ ns with vectors of 8", lines[-1])
    else:
        assert verdicts["compiler"] == "warning" and "NUMBA_DISABLE_JIT" in lines[-1]


def group(errors, drift):
    """Results of the small run as a study might have stored them."""
    variables = {"error": (("h",), errors), "casimir_drift": (("h", "casimir"), np.full((len(errors), 1), drift))}
    return Group("main", "splitting", {"h": 2.0 ** -np.arange(4, 8), "casimir": np.zeros(1, int)}, variables, {})


def test_wrong_numbers_are_noticed():
    known = np.array(doctor._ERRORS)
    assert str(doctor._numbers(group(known * (1 + 1e-13), 1e-14))).startswith("ok       numbers")
    wrong = known * np.array([1, 1, 1 + 1e-8, 1])
    for one in (group(wrong, 1e-14), group(known, 1e-9), group(known * np.nan, 1e-14), group(known, np.nan)):
        finding = doctor._numbers(one)
        assert not finding.sound and str(finding).startswith("wrong    numbers") and "do not trust" in str(finding)


@pytest.mark.parametrize("error", [StorageError("cannot write /x"), OSError("no room"), doctor.CompilationError("no")])
@pytest.mark.skipif(not COMPILED, reason="nothing is run")
def test_a_run_that_fails_is_one_line_and_exit_code_1(monkeypatch, error):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(doctor, "run", fail)
    code, out, err = call("doctor")
    assert (code, err) == (1, "spi: a test failed, see above\n")
    assert out.splitlines()[-1].startswith(f"wrong    numbers   the small run failed ({error})")


def test_what_can_be_better_is_a_warning_with_a_remedy(monkeypatch, without_run):
    monkeypatch.setattr(doctor, "CACHE_PROBLEM", "/nowhere: Permission denied")
    monkeypatch.setattr(doctor, "processors", lambda: 1000)
    monkeypatch.setattr(doctor.processor, "is_fused", lambda: False)
    code, out, err = without_run()
    assert (code, err) == (0, "")
    for name, words in (
        ("kernels", "/nowhere: Permission denied: every run compiles anew; set SPI_CACHE_DIR"),
        ("threads", "NUMBA_NUM_THREADS"),
        ("processor", "fused operations"),
    ):
        assert re.search(rf"^warning  {name} .*{words}", out, re.MULTILINE), name


def test_parts_of_numba_that_are_left_out_are_said_with_what_is_lost(without_run, monkeypatch):
    monkeypatch.setenv("SPI_WITHOUT", "rounding,names")
    monkeypatch.setattr(doctor.private, "missing", lambda part: ("numba.core.x",) if part == "cache" else ())
    code, out, _ = without_run()
    lost = private.LOST
    assert code == 0
    assert [line for line in out.splitlines() if line.startswith("warning  compiler")] == [
        f"warning  compiler  without cache, as Numba has no numba.core.x: {lost['cache']}",
        f"warning  compiler  without rounding, by SPI_WITHOUT: {lost['rounding']}",
        f"warning  compiler  without names, by SPI_WITHOUT: {lost['names']}",
    ]
    assert "vectors as LLVM chooses" in out


def test_the_room_for_kernels_and_the_speed(monkeypatch):
    assert str(doctor._cache()).startswith("ok       kernels")
    monkeypatch.setattr(doctor, "_LEAST_ROOM", 1e18)
    assert "SPI_CACHE_DIR" in str(doctor._cache())
    assert str(doctor._speed(10.0, 5.5)).startswith("ok ")
    assert "1.8 times as long as predicted" in str(doctor._speed(10.0, 5.5))
    assert "as long" not in str(doctor._speed(6.0, 5.5))
    assert str(doctor._speed(100.0, 5.5)).startswith("warning ")


@pytest.mark.parametrize(
    ("features", "bits"), [({"avx2", "sse2", "fma"}, 256), ({"neon"}, 128), ({"avx512f", "avx2", "fma"}, 512)]
)
def test_the_width_of_vectors(monkeypatch, features, bits):
    monkeypatch.setattr(doctor.processor, "WISH", "512")
    monkeypatch.setattr(doctor.processor, "_features", lambda: features)
    assert str(doctor._vectors("some processor")).endswith(f": vectors of {bits} bits")
