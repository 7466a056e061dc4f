"""Specs that tests write and load."""

import pytest

from spi.running.run import load


@pytest.fixture
def load_text(tmp_path):
    """Load a spec with overrides."""

    def load_text(text, *overrides):
        path = tmp_path / "s.yaml"
        path.write_text(text, encoding="utf-8")
        return load(path, overrides=overrides)

    return load_text
