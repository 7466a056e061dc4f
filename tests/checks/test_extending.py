"""A system is one class and a composition one row: those of extending.py have all that the package's own have."""

import inspect
import re
import textwrap
from pathlib import Path

import extending
import numpy as np
import pytest
import test_models
from extending import Oscillator
from helpers import LANES, RIGID_BODY, composed, final_states, loop_in_python, random_states, take_step

from spi.ensemble.protocol import hamiltonian
from spi.models import MODELS
from spi.schemes import SCHEMES, has_theory, typical_ns
from spi.schemes.splitting import has_antithetic_path
from spi.schemes.stages import compositions

NAME = "splitting_noise_amid"


@pytest.fixture(autouse=True)
def registered():
    """The system and the composition, known while a test runs."""
    extending.register()
    yield
    del MODELS["oscillator"], SCHEMES[NAME]


@pytest.fixture
def case():
    """What the checks that every model must pass ask for."""
    return Oscillator((0.7,)), (0.6, -1.1)


# All of them, as if they stood here.
GENERIC = {
    name: check
    for name, check in vars(test_models).items()
    if name.startswith("test_") and "case" in inspect.signature(check).parameters
}
globals().update(GENERIC)


def test_there_are_generic_checks():
    assert len(GENERIC) == 5


def test_the_system_integrates():
    """A step is linear, y -> A (y - (0, sigma dW)), so that mean and covariance are those of a recursion."""
    model, initial, h, steps = Oscillator((0.7,)), (0.6, -1.1), 1 / 4, 16
    with loop_in_python():
        states = final_states(SCHEMES["splitting"].record, model, h=h, steps=steps, blocks=16, initial=initial)[0]
    step = np.array([[1, 0], [-h, 1]]) @ np.array([[1, h], [0, 1]])
    mean, covariance = np.array(initial), np.zeros((2, 2))
    for _ in range(steps):
        mean, covariance = step @ mean, step @ (covariance + np.diag([0, 0.7**2 * h])) @ step.T
    energy = hamiltonian(model, tuple(states))
    stderr = energy.std() / np.sqrt(energy.size)
    expected = 0.5 * (mean @ mean + np.trace(covariance))
    assert abs(energy.mean() - expected) < 4.5 * stderr
    assert abs(hamiltonian(model, initial) - expected) > 10 * stderr  # negative control: it moves


def test_the_composition_is_what_its_row_says():
    """Compiled, against the flows one after the other; other orders and other shares are other schemes."""
    row, generator, h = SCHEMES[NAME], np.random.default_rng(3), 0.3
    y, dW = random_states(generator), 0.4 * generator.standard_normal((3, LANES))
    new, _ = take_step(row.record, RIGID_BODY, h, dW, y)
    ((_, acting),) = compositions(row.composition, RIGID_BODY)
    drift, noise = [("drift", k, 0.5) for k in range(3)], [("noise", k, 1.0) for k in range(3)]
    assert list(acting) == [*drift[::-1], *noise, *drift]
    for flows, same in ((acting, True), ([*drift, *noise, *drift], False)):
        expected = np.transpose([composed(RIGID_BODY, flows, h, tuple(y[:, n]), dW[:, n]) for n in range(LANES)])
        assert (np.abs(new - expected).max() < 1e-13) == same
    assert has_theory(row, RIGID_BODY) and not has_antithetic_path(row.record)
    assert typical_ns(SCHEMES[NAME], RIGID_BODY) > typical_ns(SCHEMES["splitting"], RIGID_BODY)


def test_the_page_shows_this_code():
    """The examples of CONTRIBUTING.md stand in extending.py word for word."""
    page = Path(__file__).parents[2].joinpath("CONTRIBUTING.md").read_text(encoding="utf-8")
    source = Path(extending.__file__).read_text(encoding="utf-8")
    source += textwrap.dedent(inspect.getsource(extending.register).partition('"""\n')[2])
    shown = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(shown) == 3
    for text in shown:
        assert text in source
