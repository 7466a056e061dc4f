"""The key `noise`: what it means, what decides results, and mistakes in one line."""

import re

import numpy as np
import pytest

import spi
from spi.plugins.drivers.ensemble.drivers import Fractional, OrnsteinUhlenbeck
from spi.running.load import load
from spi.running.remarks import remarks
from spi.specs import SpecError

SPEC = """\
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: [2^-3]
reference_step: 2^-4
schemes: [splitting]
samples: 2
"""


@pytest.fixture
def loaded(tmp_path):
    np.savez(tmp_path / "a.npz", dW=np.ones((2, 16, 3)), step=2**-4)
    np.savez(tmp_path / "short.npz", dW=np.ones((2, 15, 3)), step=2**-4)
    np.savez(tmp_path / "one.npz", dW=np.ones((16, 3)), step=2**-4)
    np.savez(tmp_path / "two.npz", dW=np.ones((2, 16, 2)), step=2**-4)
    np.savez(tmp_path / "odd.npz", dW=np.ones((2, 40, 3)), step=0.03)
    np.savez(tmp_path / "coarse.npz", dW=np.ones((2, 8, 3)), step=2**-3)
    np.savez(tmp_path / "nan.npz", dW=np.full((2, 16, 3), np.nan), step=2**-4)
    np.savez(tmp_path / "stepless.npz", dW=np.ones((2, 16, 3)))
    np.save(tmp_path / "alone.npy", np.ones((2, 16, 3)))

    def loaded(noise=None, change=(), text=SPEC):
        for old, new in [change] if change else []:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "s.yaml"
        path.write_text(text + (f"noise: {noise}\n" if noise else ""), encoding="utf-8")
        return load(path)

    return loaded


def test_what_it_means(loaded):
    brownian = loaded()
    assert brownian.cases[0].noise is None and "noise" not in brownian.effective["cases"]["main"]
    assert loaded("{kind: brownian}").hash == brownian.hash
    for text, law in (
        ("{kind: ornstein_uhlenbeck, tau: 1/8}", OrnsteinUhlenbeck(0.125)),
        ("{kind: fractional, hurst: 0.7}", Fractional(0.7)),
    ):
        found = loaded(text)
        assert found.cases[0].noise.law == law and found.hash != brownian.hash
        assert len(remarks(found)) == 1 and not remarks(brownian)
    found = loaded("{file: a.npz}")
    assert (
        found.cases[0].noise.law.dW.shape == (2, 16, 3)
        and found.hash != loaded("{file: coarse.npz, finer: bridge}").hash
    )
    again = load(found.path, text=found.text, files=found.files)  # as in a results file
    assert again.hash == found.hash
    swept = loaded("{file: a.npz}", ("strong", "stability\nsweep: {damping: [0, 1]}"))
    assert [case.noise.law.dW.shape for case in swept.cases] == [(2, 16, 3)] * 2


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        ("{file: b.npz}", "noise.file: is 'b.npz', and there is no file"),
        ("{file: alone.npy}", "noise.file: is 'alone.npy', which holds no such arrays"),
        ("{file: stepless.npz}", "noise.file: is 'stepless.npz', which holds no such arrays"),
        ("{file: nan.npz}", "noise.file: is 'nan.npz', in which dW, which is not finite at [0, 0, 0]"),
        ("{file: short.npz}", "noise.file: has 15 increments over 2^-4, until 0.9375; must go until 1"),
        ("{file: one.npz}", "noise.file: has increments of 1 paths; must have those of 2"),
        ("{file: two.npz}", "noise.file: has increments of 2 noises; must have 3"),
        ("{file: odd.npz}", "noise.file: has increments over 0.03, and 2^-4 is no multiple"),
        ("{file: coarse.npz}", "noise.file: has increments over 2^-3, and steps go down to 2^-4; use larger"),
    ],
)
def test_mistakes_in_files_are_one_line(loaded, noise, message):
    with pytest.raises(SpecError) as caught:
        loaded(noise)
    (told,) = caught.value.messages
    assert re.sub(r"^.*s\.yaml:\d+: ", "", told).startswith(message), told


def test_increments_in_python():
    law = {"kind": "fractional", "hurst": 0.7}
    dX = spi.increments(5, 3, 0.25, 8, noises=2, noise=law)
    later = spi.increments(5, 3, 0.25, 2, noises=2, noise=law, first_step=4, final_time=2)
    assert np.array_equal(later, dX[4:6])
    body = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
    one = spi.Integrator(body, "splitting", 0.25, initial=[1, 0, 0], noise=law)
    y = one.start(3)
    assert np.array_equal(one.sample(y, 4, seed=2), one.steps(y, *one.noise(3, 4, seed=2)))
    for wrong, message in (
        ({"kind": "fractional"}, "noise.hurst: missing key 'hurst'"),
        ({"file": "a"}, "noise: is a file"),
    ):
        with pytest.raises(spi.SpecError, match=message):
            spi.increments(5, 3, 0.25, 8, noise=wrong)
