"""That a further estimator of weak errors is a folder and a line."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_kinds import SPEC

from spi.kinds.weak.estimators import ESTIMATORS
from spi.specs.keys import Keys

WEAK = (
    SPEC.replace("KIND", "weak")
    .replace("step: 2^-3", "steps: [2^-2, 2^-3]\nreference_step: 2^-4")
    .replace("samples: 70", "estimators: [guess]\nper_step: 3")
    .replace("{a: y1^2, b: y3}", "{phi: y1^2}")
)
LINE = '    "guess": Estimator("spi.kinds.weak.estimators.guess"),\n'


@pytest.mark.parametrize("name", ESTIMATORS)
def test_every_estimator_has_what_is_asked_of_it(name):
    keys, study = ESTIMATORS[name].keys, ESTIMATORS[name].study
    assert issubclass(keys.Keys, Keys) and keys.LABEL and len(keys.LOOK) == 2
    assert callable(keys.check) and callable(study.plan)
    with pytest.raises(AttributeError, match="plots"):
        _ = ESTIMATORS[name].plots


@pytest.fixture
def spi(tmp_path):
    """Commands of a copy of the package that has the estimator of tests/guess_estimator, with its line."""
    package = tmp_path / "copy" / "spi"
    shutil.copytree(Path(__file__).parents[2] / "spi", package, ignore=shutil.ignore_patterns("__pycache__"))
    folder = package / "kinds" / "weak" / "estimators"
    shutil.copytree(Path(__file__).parents[1] / "guess_estimator", folder / "guess")
    text = (folder / "__init__.py").read_text(encoding="utf-8")
    place = text.index("}\n", text.index("ESTIMATORS = {"))
    (folder / "__init__.py").write_text(text[:place] + LINE + text[place:], encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(package.parent), "SPI_CACHE_DIR": str(tmp_path / "cache")}

    def run(*words):
        command = [sys.executable, "-c", "from spi.cli import main; main()", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    return run


def test_a_further_estimator_is_a_folder_and_a_line(spi, tmp_path):
    (tmp_path / "mine.yaml").write_text(WEAK, encoding="utf-8")
    done = spi("run", "mine.yaml")
    assert done.returncode == 0, done.stderr
    rows = json.loads(spi("show", "results/mine.h5", "--format", "json").stdout)
    assert [(row["estimator"], row["h"], row["error"]) for row in rows] == [
        ("guess", 0.25, 0.75),
        ("guess", 0.125, 0.375),
    ]
    (tmp_path / "none.yaml").write_text(WEAK.replace("per_step: 3\n", ""), encoding="utf-8")
    refused = spi("check", "none.yaml")
    assert refused.returncode == 2 and "missing key 'per_step', needed by the estimator 'guess'" in refused.stderr
