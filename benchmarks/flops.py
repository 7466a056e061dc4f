"""Floating-point operations of one step and path, counted by numbers that count, on their way through the words.

    python benchmarks/flops.py [model ...]

The package runs uncompiled on a block whose states and increments are such numbers.  Additions, subtractions,
multiplications, divisions and square roots count 1, so a fused multiply-add counts 2.  Counted is what the compiled
loop over lanes has to do: an expression that occurs twice between two loads counts once, what does not depend on the
path (h, sigma, moments of inertia) is computed outside the loop and counts nothing, and products with 0.0 count, since
they may not be left out.  Comparisons, signs, integers and bits are not floating-point arithmetic and count nothing,
and so neither do the ten rounds of Philox.

Angles are those of a step of 2^-16, hence tiny ones; an implicit scheme makes the iterations that it needs there.

Supports: no page; it is for finding.

Short form: lotka_volterra
"""

import json
import os
import sys

if __name__ == "__main__":
    os.environ["NUMBA_DISABLE_JIT"] = "1"

import numpy as np

COUNTS = dict.fromkeys(("add", "subtract", "multiply", "divide", "sqrt"), 0)
_KNOWN = {}  # (operation, operands) -> number, what a compiler would not compute again


class Counted(np.lib.mixins.NDArrayOperatorsMixin):
    """A number that differs from path to path; a plain float is one that does not.

    Numbers with the same ``name`` are equal up to their signs.
    """

    def __init__(self, value, name=None, negated=False):
        self.value, self.name, self.negated = float(value), name or object(), negated

    def __float__(self):
        return self.value

    def __array_ufunc__(self, ufunc, method, *operands, **_):
        """All operators come here as NumPy's functions, and so do np.sqrt and its like."""
        if ufunc.__name__ in COUNTS:
            return calculate(ufunc, *operands)
        if ufunc is np.negative:
            return Counted(-self.value, self.name, not self.negated)
        value = ufunc(*map(float, operands))
        return value if isinstance(value, np.bool_) else Counted(value)


def calculate(ufunc, *operands):
    """The result of a counted operation, at least one of whose operands differs from path to path."""
    ufunc, operands, negated = without_signs(ufunc, operands)
    if ufunc in (np.multiply, np.divide) and 1.0 in map(plain, operands[1:]):
        result = operands[0]
    elif ufunc is np.multiply and plain(operands[0]) == 1.0:
        result = operands[1]
    else:
        names = [(x.name, x.negated) if isinstance(x, Counted) else x for x in operands]
        key = ufunc, frozenset(names) if ufunc in (np.add, np.multiply) else tuple(names)
        if key not in _KNOWN:
            with np.errstate(all="ignore"):
                _KNOWN[key] = Counted(ufunc(*map(float, operands)))
            COUNTS[ufunc.__name__] += 1
        result = _KNOWN[key]
    return -result if negated else result


def plain(x):
    """The value of a plain float, None of a counted number."""
    return None if isinstance(x, Counted) else x


def without_signs(ufunc, operands):
    """(ufunc, operands, whether to change the sign of the result), as a compiler moves signs out of the way."""
    signs = [isinstance(x, Counted) and x.negated for x in operands]
    if ufunc in (np.multiply, np.divide):
        return ufunc, [-x if sign else x for x, sign in zip(operands, signs, strict=True)], signs[0] != signs[1]
    if ufunc in (np.add, np.subtract) and signs[1]:
        return np.subtract if ufunc is np.add else np.add, [operands[0], -operands[1]], False
    if ufunc is np.add and signs[0]:
        return np.subtract, [operands[1], -operands[0]], False
    return ufunc, operands, False


class Memory(np.ndarray):
    """An array from which a number is loaded anew each time, as a loop does that cannot know what was stored."""

    def __getitem__(self, place):
        value = super().__getitem__(place)
        return value if isinstance(value, np.ndarray) else Counted(value)


class CountingNumpy:
    """NumPy, but what comes from integers is counted."""

    float64 = Counted

    def __getattr__(self, name):
        return getattr(np, name)


def let_numbers_count():
    """Words that turn numbers into plain floats, or make them from integers, shall keep or make counted ones."""
    from spi.ensemble import lanes
    from spi.numerics import elementary, rng

    made_from_bits = elementary.from_bits
    elementary.from_bits = lambda i: Counted(made_from_bits(i))
    lanes.float = lambda x: x
    elementary.float = Counted
    rng.np = CountingNumpy()


def counted(work, times):
    """What `work` counts, divided by `times`: {operation: number}."""
    _KNOWN.clear()
    before = dict(COUNTS)
    work()
    return {operation: (COUNTS[operation] - before[operation]) / times for operation in COUNTS}


def memory(values):
    """A :class:`Memory` with these values."""
    array = np.empty(len(values), object).view(Memory)
    array[:] = values
    return array


def with_other_numbers(parameter):
    """No factor of 1, which would not count, where a parameter of a model is 1."""
    if isinstance(parameter, tuple):
        return tuple(map(with_other_numbers, parameter))
    return 1.0625 * parameter if isinstance(parameter, float) else parameter


def of_step(scheme, model, initial, h):
    """Operations of one step and path, without its random numbers."""
    from spi.ensemble.protocol import noises
    from spi.ensemble.scheme_protocol import advance, memory_size, report_row, substeps, work_size
    from spi.numerics.rng import LANES

    generator = np.random.default_rng(1)
    model = type(model)(*map(with_other_numbers, model))
    y = memory(np.concatenate([np.repeat(initial, LANES), np.zeros(memory_size(scheme, model))]))
    dW = memory(np.sqrt(h) * generator.standard_normal((2 * substeps(scheme) - 1) * noises(model) * LANES))
    coins, work = np.where(np.arange(LANES) % 2, 1.0, -1.0), memory(np.zeros(work_size(scheme, model)))
    return counted(lambda: advance(scheme, model, h, dW, coins, y, work, report_row()), LANES)


def of_normal():
    """Operations behind one increment of one Wiener process."""
    from spi.numerics.rng import LANES, STEPS_PER_DRAW, draw_increments

    n = STEPS_PER_DRAW * LANES
    zero, increments = np.uint64(0), np.empty(n, object)
    return counted(
        lambda: draw_increments(zero, zero, zero, zero, zero, 0.5, np.empty(n, np.uint64), increments, LANES), n
    )


def main():
    from examples import STEP, TIMED, example, row, why_not

    from spi.schemes import SCHEMES

    let_numbers_count()
    result = {"normal": of_normal()}
    for name in sys.argv[1:] or TIMED:
        model, initial = example(name)
        for scheme in SCHEMES:
            if not why_not(scheme, model):
                result[f"{name} {scheme}"] = of_step(row(scheme).record, model, initial, STEP)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
