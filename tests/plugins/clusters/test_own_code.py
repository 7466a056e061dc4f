"""Shards and checks of results of models from a Python file."""

import json
from pathlib import Path

import pytest
import test_own_models
from damage import call as command
from own_models import OSCILLATOR
from reuse_cases import everything

from spi import storage
from spi.plugins.clusters.running import shards, verify
from spi.running import run as runs

oscillator = test_own_models.oscillator  # fixture


def test_shards_have_the_numbers_of_a_run_which_are_verified_without_the_file(oscillator):
    experiment = oscillator()
    path = runs.run(experiment, "out")
    for number in (1, 2):
        shards.run_shard(experiment, shards.Shard(number, 2), "shards")
    assert everything(shards.merge(experiment, "shards")) == everything(path)
    Path("my_model.py").unlink()
    found = verify.verify(path, 1, trust_code=True)
    assert found.checked and not found.different


def test_code_in_a_results_file_is_not_run_unasked(oscillator, tmp_path):
    """Not by `spi verify`, whose file somebody else may have written; only where an equal file lies at its path."""
    path = runs.run(oscillator(), tmp_path)
    foreign = "from pathlib import Path\n\nPath('ran').touch()\n" + OSCILLATOR
    stored = storage.read(path)
    sources = {"model_sources": json.dumps({"my_model.py": foreign})}
    storage.write(path, stored._replace(attributes=stored.attributes | sources))
    refused = f"spi: {path}: holds Python code, my_model.py, that equals no file of that path here; read it first"
    for text in (None, foreign + "#\n"):
        if text is not None:
            Path("my_model.py").write_text(text)
        code, _, told = command("verify", path)
        assert code == 2 and told.startswith(refused) and told.count("\n") == 1
        assert not Path("ran").exists()
    folder = Path("experiments")
    folder.mkdir()
    (folder / "my_model.py").write_text(foreign)
    with pytest.raises(storage.StorageError, match="means something else"):  # since this code is another
        verify.verify(path, 1)
    assert Path("ran").exists()
    (folder / "my_model.py").unlink()
    Path("ran").unlink()
    assert "--trust-code" in command("verify", "--help")[1]
