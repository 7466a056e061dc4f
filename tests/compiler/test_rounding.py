"""Which products are rounded, and that bits do not depend on the width of vectors."""

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED
from llvmlite import ir

from spi.compiler import private, processor, rounding
from spi.compiler.dispatch import device

PROJECT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(not COMPILED, reason="about the compiler")


@device
def left(a, b, c, d):
    return a * b + c * d


@device
def less(a, b, c, d):
    return a * b - c * d


@device
def right(a, b, c, d):
    return (c / d) - a * b


@device
def twice(a, b, c, d):
    product = a * b
    return (product + c) / product


@device
def squared(a, b, c, d):
    return a * a * b + c


def exactly(text, **values):
    """The value of an expression in exact arithmetic, rounded once."""
    return float(eval(text, {name: Fraction(value) for name, value in values.items()}))


@pytest.mark.parametrize(
    ("function", "text", "rest"),
    [
        (left, "a * b + r", lambda a, b, c, d: c * d),
        (less, "a * b - r", lambda a, b, c, d: c * d),
        (right, "r - a * b", lambda a, b, c, d: c / d),
        (twice, "(r + c) / r", lambda a, b, c, d: a * b),  # a product that is used twice is rounded
        (squared, "r * b + c", lambda a, b, c, d: a * a),
    ],
)
def test_one_product_is_fused_and_the_first_of_two(function, text, rest):
    if not processor.is_fused():
        pytest.skip("this processor has no fused operations")
    generator = np.random.default_rng(1)
    points = generator.normal(size=(100, 4))
    expected = [exactly(text, a=a, b=b, c=c, d=d, r=rest(a, b, c, d)) for a, b, c, d in points.tolist()]
    if function is twice:  # here the sum is rounded as well, before the division
        expected = [(rest(*point) + point[2]) / rest(*point) for point in points.tolist()]
    assert [function(*point) for point in points.tolist()] == expected
    plain = [function.__wrapped__(*point) for point in points.tolist()]
    assert function is twice or plain != expected  # that rounding is noticed at all


#: What the first block of the model of an experiment does, and whether kernels have vectors of 512 bits.
PROGRAM = """
import hashlib, sys
import numpy as np
from spi.ensemble import loop
from spi.ensemble.protocol import in_kernels
from spi.ensemble.increments import brownian
from spi.running.run import load
from spi.schemes import SCHEMES

for word in sys.argv[1:]:
    experiment, scheme = word.split("/")
    case, entry = load(f"experiments/{experiment}.yaml", "quick").cases[0], SCHEMES[scheme]
    terms = 2 if "areas" in scheme else 0
    times = loop.grid(2.0**-4, 32, truncate=entry.needs_truncation, area_terms=terms)
    what = entry.record, in_kernels(case.model), np.array(case.initial, float), times, brownian(1), 0, 1, 64
    print(word, hashlib.sha256(loop.integrated(*what)[0].tobytes()).hexdigest())
print("zmm", any("zmm" in text for text in loop.integrate.inspect_asm().values()))
"""


def outcome(bits, words):
    """What the program prints with vectors of so many bits."""
    environment = {**os.environ, processor.VARIABLE: str(bits), private.VARIABLE: "cache"}
    command = [sys.executable, "-c", PROGRAM, *words]
    answer = subprocess.run(
        command, env=environment, cwd=PROJECT, capture_output=True, text=True, check=False, timeout=900
    )
    *states, wide = answer.stdout.splitlines() or [answer.stderr.strip()]
    return states, wide


def assert_equal_bits(words):
    widths = [bits for bits in processor.WIDTHS if bits <= processor.vector_bits()]
    found = {bits: outcome(bits, words) for bits in (widths[0], widths[-1])}
    (narrow, _), (wide, _) = found[widths[0]], found[widths[-1]]
    assert len(wide) == len(words), found
    assert narrow == wide
    if not any("zeitlin" in word for word in words):  # whose vectors are written as such, eight floats each
        assert [found[bits][1] for bits in (widths[0], widths[-1])] == ["zmm False", f"zmm {widths[-1] == 512}"]


def test_nothing_is_left_for_llvm_to_choose():
    """No operation may be fused any more but those that are written as fused ones, and the width is said."""
    module, kind = ir.Module(), ir.DoubleType()
    function = ir.Function(module, ir.FunctionType(kind, [kind] * 4), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    a, b, c, d = function.args
    products = [builder.fmul(*pair, flags=["contract"]) for pair in ((a, b), (c, d))]
    builder.ret(builder.fadd(*products, flags=["contract"]))
    rounding.round_explicitly(module)
    assert "contract" not in str(module) and f'"prefer-vector-width"="{processor.vector_bits()}"' in str(module)
    assert ("@llvm.fma.f64" in str(module).replace('"', "")) == processor.is_fused()


ANY = ("splitting", "splitting_order2", "splitting_symmetric", "euler_maruyama")
#: Schemes by experiments, which have a model each; the last two are a system in YAML and arrays as states.
TOGETHER = {
    "rigid_body_strong": (*ANY, "midpoint", "splitting_areas", "munthe_kaas_midpoint", "isospectral_midpoint"),
    "maxwell_bloch_strong": (*ANY, "midpoint"),
    "lotka_volterra_positivity": (*ANY, "midpoint"),
    "sine_euler_strong": (*ANY, "midpoint"),
    "heavy_top_strong": (*ANY, "midpoint", "splitting_areas", "munthe_kaas_midpoint"),
    "zeitlin_strong": ANY,
}


@pytest.mark.slow
@pytest.mark.needs("systems")
@pytest.mark.parametrize("experiment", TOGETHER)
def test_bits_do_not_depend_on_the_width_of_vectors_for_any_model(experiment):
    assert_equal_bits([f"{experiment}/{scheme}" for scheme in TOGETHER[experiment]])


def test_what_is_not_a_width_is_refused():
    assert outcome(511, []) == ([], f"spi: {processor.VARIABLE} is '511', which is not 128, 256 or 512")
