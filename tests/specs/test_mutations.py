"""Changed experiments: ``spi check`` takes each or refuses it in a line for each mistake, and writes nothing."""

import random

import mutations
import pytest
from damage import MANY


@pytest.mark.share(2)
@pytest.mark.parametrize("seed", range(20 * MANY))
def test_a_changed_experiment_is_taken_or_refused_in_plain_lines(tmp_path, seed):
    draw = random.Random(f"mutations {seed}")
    codes = set()
    for _ in range(10):
        what, code, right, err, text = mutations.answer(draw, tmp_path)
        assert right, (what, code, err, text)
        codes.add(code)
    assert 2 in codes


def test_the_experiments_themselves_are_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(mutations, "mutated", lambda draw, text: ("nothing", False, text))
    assert all(mutations.answer(random.Random(n), tmp_path)[1:3] == (0, True) for n in range(5))
