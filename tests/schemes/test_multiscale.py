"""The multiscale system (eq. prob_eps): its schemes against the paper's formulas, their limits, and how others fail."""

import mpmath
import numpy as np
import pytest
from helpers import (
    COMPILED,
    INITIAL,
    LANES,
    RIGID_BODY,
    Increments,
    WithoutCorrection,
    compiled_only,
    final_states,
    loop_in_python,
    simulate,
    take_steps,
)
from mpmath import mpf

from spi.ensemble.protocol import (
    casimirs,
    dimension,
    drift_flow,
    drift_gradient,
    noise_flow,
    noise_gradient,
    noises,
    pieces,
    structure,
)
from spi.ensemble.scheme_protocol import memory_size
from spi.models import LotkaVolterra, MaxwellBloch, SineEuler
from spi.numerics.angles import ANY_ANGLES
from spi.schemes import SCHEMES
from spi.schemes.asymptotic import (
    AsymptoticPreserving,
    ExplicitEuler,
    ImplicitEuler,
    ImplicitMidpoint,
    MultiscaleEuler,
    increment_and_process,
)
from spi.schemes.splitting import LIE_TROTTER

RULES = {"implicit Euler": ImplicitEuler(), "midpoint": ImplicitMidpoint(), "explicit Euler": ExplicitEuler()}
IMPLICIT, MIDPOINT, EXPLICIT = RULES.values()
#: What is tested for all models: scheme and rule.
PAIRS = [
    (AsymptoticPreserving, IMPLICIT),
    (AsymptoticPreserving, MIDPOINT),
    (MultiscaleEuler, EXPLICIT),
    (MultiscaleEuler, IMPLICIT),
]
NAMES = ["AP", "AP midpoint", "explicit", "semi-implicit"]


@pytest.fixture
def generator():
    return np.random.default_rng(42)


def normals(generator, model, steps):
    return generator.standard_normal((steps, noises(model), LANES))


def start(generator, model):
    """States of length about 1, positive ones for populations."""
    y = generator.standard_normal((dimension(model), LANES))
    return np.exp(0.5 * y) if isinstance(model, LotkaVolterra) else y / np.linalg.norm(y, axis=0)


def at_rest(y=INITIAL):
    """The same state in all lanes."""
    return np.repeat(np.array(y)[:, np.newaxis], LANES, axis=1)


def go(scheme, model, h, dW, y, z=None):
    """States and processes after steps with increments dW; the processes begin at 0 unless given."""
    d = dimension(model)
    if memory_size(scheme, model):
        y = np.vstack([y, np.zeros((noises(model), LANES)) if z is None else z])
    end, _ = take_steps(scheme, model, h, dW, y)
    return end[:d], end[d:]


def distance(a, b):
    """Of states [component, lane], in every lane."""
    return np.linalg.norm(a - b, axis=0)


def mean_square_distance(a, b):
    return np.sqrt((distance(a, b) ** 2).mean())


def slope(x, y):
    """Of a line through the logarithms."""
    return np.polyfit(np.log(x), np.log(y), 1)[0]


MODELS = {
    "rigid_body": RIGID_BODY,
    "maxwell_bloch": MaxwellBloch((0.5, 1.5)),
    "sine_euler": SineEuler((0.5, 0.2, 0.7, 0.4)),
    "lotka_volterra": LotkaVolterra((0.3,)),
}

asymptotic_preserving = pytest.mark.parametrize("rule", [IMPLICIT, MIDPOINT], ids=["implicit Euler", "midpoint"])


# --- the paper's formulas --------------------------------------------------------------------------------------------


def of_the_paper(rule, eps, h, dW, xi):
    """(increment, new xi), as section APsplit prints them."""
    if rule is IMPLICIT:
        new = (xi + dW / eps) / (1 + h / eps**2)
        return h * new / eps, new
    if rule is MIDPOINT:  # the equation, linear in the new xi, solved for it
        new = ((1 - h / (2 * eps**2)) * xi + dW / eps) / (1 + h / (2 * eps**2))
        return h * (xi + new) / (2 * eps), new
    return h * xi / eps, xi - h / eps**2 * xi + dW / eps


def printed_increments(rule, eps, h, dW, z):
    """The increments [step, noise, lane] and the last z = eps xi, by 40 digits."""
    with mpmath.workdps(40):
        exact = np.vectorize(mpf, otypes=[object])
        eps, h, dW = mpf(eps), mpf(h), exact(dW)
        xi = exact(z) / eps
        increments = []
        for n in range(len(dW)):
            increment, xi = of_the_paper(rule, eps, h, dW[n], xi)
            increments.append(increment)
        return np.array(increments).astype(float), (eps * xi).astype(float)


def flows(model, h, increments, y):
    """Eq. slpI with these increments, by the model's own flows, which other tests check."""
    for k, sigma in enumerate(model.sigma):
        y = noise_flow(model, k, sigma * increments[k], y, ANY_ANGLES)
    for k in range(pieces(model)):
        y = drift_flow(model, k, h, y, ANY_ANGLES)
    return y


def fields(model, h, increments, y):
    """y + h B grad H + sum_k sigma_k B grad Ĥ_k times the increment."""
    new = np.array(y) + h * np.array(structure(model, y, drift_gradient(model, y)))
    for k, sigma in enumerate(model.sigma):
        new += sigma * increments[k] * np.array(structure(model, y, noise_gradient(model, k, y)))
    return tuple(new.tolist())


def transcribed(scheme, model, h, increments, y):
    """The states after steps with these increments of the processes, lane by lane."""
    step = flows if isinstance(scheme, AsymptoticPreserving) else fields
    lanes = []
    for lane in range(LANES):
        state = tuple(y[:, lane].tolist())
        for row in increments:
            state = step(model, h, row[:, lane].tolist(), state)
        lanes.append(state)
    return np.transpose(lanes)


def relative(a, b):
    return (distance(a, b) / np.linalg.norm(b, axis=0)).max()


@pytest.mark.share
@pytest.mark.parametrize("eps", [1.0, 0.1, 1e-3])
@pytest.mark.parametrize(("kind", "rule"), PAIRS, ids=NAMES)
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_steps_are_those_of_the_paper(model, kind, rule, eps, generator):
    """One step from processes that have begun, and four more; explicit steps only where they are stable."""
    h = 0.5 * eps * eps if kind is MultiscaleEuler and rule is EXPLICIT else 0.1
    y, z = start(generator, model), eps * 0.5 * generator.standard_normal((noises(model), LANES))
    dW = np.sqrt(h) * normals(generator, model, 5)
    scheme = kind(eps, rule)
    for steps in (1, 5):
        increments, last = printed_increments(rule, eps, h, dW[:steps], z)
        new, processes = go(scheme, model, h, dW[:steps], y, z)
        scale = np.sqrt(h)
        assert np.abs(processes - last).max() < 1e-14 * scale
        assert relative(new, transcribed(scheme, model, h, increments, y)) < (1e-13 if steps == 1 else 1e-12)
    if eps == 1.0:  # negative control: another rule, and without processes at all
        others = [printed_increments(other, eps, h, dW, z)[0] for other in RULES.values() if other is not rule]
        for wrong in (*others, dW):
            assert relative(new, transcribed(scheme, model, h, wrong, y)) > 1e-3


# --- the ensemble ----------------------------------------------------------------------------------------------------


def test_every_path_and_every_step_size_has_its_own_processes_which_begin_at_zero():
    """Through the ensemble, against steps of one block at a time with the ensemble's increments."""
    scheme, doublings = AsymptoticPreserving(0.3, IMPLICIT), (0, 1, 1, 3)
    setting = {"h": 2.0**-6, "steps": 16, "doublings": doublings, "blocks": 2, "first_block": 3}
    with loop_in_python():
        found = final_states(scheme, **setting)
    drawn, _ = simulate(Increments(), snapshots=0, **setting)
    for doubling, y, dW in zip(doublings, found, drawn, strict=True):
        for block in range(2):
            lanes = slice(block * LANES, (block + 1) * LANES)
            expected, _ = go(scheme, RIGID_BODY, setting["h"] * 2**doubling, dW[:, :, lanes], at_rest())
            assert np.abs(y[:, lanes] - expected).max() < 1e-14


# --- small eps -------------------------------------------------------------------------------------------------------


@pytest.mark.share
@pytest.mark.parametrize("h", [1e-3, 0.1, 1.0])
@pytest.mark.parametrize("eps", [1e-1, 1e-3, 1e-6, 1e-10, 1e-160, 0.0])
@asymptotic_preserving
def test_nothing_overflows(rule, eps, h, generator):
    """h/eps^2 up to 1e320.  The processes are as small as they should be, and the sphere is kept."""
    y = start(generator, RIGID_BODY)
    dW = np.sqrt(h) * normals(generator, RIGID_BODY, 20)
    new, z = go(AsymptoticPreserving(eps, rule), RIGID_BODY, h, dW, y)
    assert np.abs(np.linalg.norm(new, axis=0) - 1.0).max() < 1e-13
    u = eps * eps / h
    assert np.abs(z).max() <= 2 * np.abs(dW).sum(axis=0).max() * min(u, 1.0)  # also says that they are finite


@asymptotic_preserving
@pytest.mark.parametrize("eps", [10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-10])
def test_nothing_cancels(rule, eps, generator):
    """Increments and processes by 40 digits, each to rounding of its own size, not of a larger one."""
    h, dW = 0.3, generator.standard_normal((1, 1, 200))
    z = np.zeros((1, 200)) if rule is MIDPOINT else eps * generator.standard_normal((1, 200))
    increments, last = printed_increments(rule, eps, h, dW, z)
    increment, new = increment_and_process(rule, eps, h, dW[0], z)
    whole = np.abs(z) + np.abs(dW[0])  # the increment is a multiple of z + dW
    share = eps**2 / (h + eps**2)
    assert np.abs((increment - increments[0]) / whole).max() < 4e-16
    assert np.abs((new - last) / whole).max() < 8e-16 * share


@pytest.mark.parametrize("h", [0.1, 1 / 93, 1 / 99, 2.0**-5])  # h * (1 / h) is not 1 for the second and third
@asymptotic_preserving
def test_for_eps_0_it_is_the_splitting_scheme_to_the_last_bit(rule, h, generator):
    y, dW = start(generator, RIGID_BODY), np.sqrt(h) * normals(generator, RIGID_BODY, 20)
    new, z = go(AsymptoticPreserving(0.0, rule), RIGID_BODY, h, dW, y)
    assert np.array_equal(new, go(LIE_TROTTER, RIGID_BODY, h, dW, y)[0])
    assert not z.any()


@asymptotic_preserving
def test_it_tends_to_the_splitting_scheme(rule, generator):
    """At a fixed h, eps xi is of the size of eps^2/h sqrt(h), so that the difference is of order 2 in eps, not 1."""
    h = 0.25
    y, dW = start(generator, RIGID_BODY), np.sqrt(h) * normals(generator, RIGID_BODY, 8)
    limit, _ = go(LIE_TROTTER, RIGID_BODY, h, dW, y)

    def difference(eps):
        return distance(go(AsymptoticPreserving(eps, rule), RIGID_BODY, h, dW, y)[0], limit)

    eps = 10.0 ** -np.arange(1, 7)
    differences = [difference(e).mean() for e in eps]
    assert differences[0] > 1e-2  # the first is far away
    assert slope(eps[1:], differences[1:]) == pytest.approx(2.0, abs=0.02)
    assert differences[1] / differences[2] == pytest.approx(100, rel=0.1)
    assert difference(1e-12).max() < 1e-14


@compiled_only
@asymptotic_preserving
def test_where_the_processes_are_resolved_it_is_the_first_order_in_eps_that_counts(rule, generator):
    """h far below eps^2: y^eps - y is of the size of eps xi_k, as in Proposition propo:multi."""
    h, steps = 2.0**-13, 2**13
    y, dW = at_rest(), np.sqrt(h) * normals(generator, RIGID_BODY, steps)
    limit, _ = go(LIE_TROTTER, RIGID_BODY, h, dW, y)
    eps = np.array([0.2, 0.1, 0.05])
    differences = [mean_square_distance(go(AsymptoticPreserving(e, rule), RIGID_BODY, h, dW, y)[0], limit) for e in eps]
    assert 0.85 < slope(eps, differences) < 1.15


# --- Casimirs --------------------------------------------------------------------------------------------------------


def casimir_errors(scheme, model, h, steps):
    """The largest relative change of the Casimirs, in every lane."""
    generator = np.random.default_rng(6)
    y = start(generator, model)
    end, _ = go(scheme, model, h, np.sqrt(h) * normals(generator, model, steps), y)
    before, after = (np.array([casimirs(model, tuple(c.tolist())) for c in states.T]) for states in (y, end))
    return np.abs((after - before) / np.abs(before[:, :1])).max(axis=1)


@pytest.mark.parametrize("rule", [EXPLICIT, IMPLICIT], ids=["explicit", "semi-implicit"])
def test_the_comparators_do_not_keep_them(rule):
    for name in ("rigid_body", "maxwell_bloch", "sine_euler"):
        errors = casimir_errors(MultiscaleEuler(1.0, rule), MODELS[name], 0.01, 100 if COMPILED else 20)
        assert np.median(errors) > 1e-4


def summed(dW, times):
    """Increments of steps that are so many times as large."""
    return dW.reshape(-1, times, *dW.shape[1:]).sum(axis=1)


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_increments_add_up_to_the_wiener_process_less_the_change_of_z(rule, generator):
    """As eps xi_k/eps dt = dW_k - eps d xi_k says; nothing of the Wiener process is lost."""
    with mpmath.workdps(60):
        eps, h, z = mpf("0.1"), mpf("0.015"), mpf("0.03")
        total, first, dW = mpf(0), z, [mpf(x) for x in generator.standard_normal(50)]
        for x in dW:
            increment, z = increment_and_process(rule, eps, h, x, z)
            total += increment
        assert abs(total - (sum(dW) + first - z)) < mpf(10) ** -57
        assert abs(total - sum(dW)) > 1e-3
    z = first = generator.standard_normal(1000)
    total, walk = np.zeros(1000), np.zeros(1000)
    for _ in range(1000):
        x = 0.1 * generator.standard_normal(1000)
        increment, z = increment_and_process(rule, 0.1, 0.015, x, z)
        total, walk = total + increment, walk + x
    assert np.abs(total - (walk + first - z)).max() < 1e-12


def test_for_a_fixed_eps_all_schemes_have_one_limit_and_order_1(generator):
    """The equation is a random ODE and its noise additive, so that the strong order is 1 for all of them."""
    model, eps = RIGID_BODY, 0.5
    finest, powers = (2**12, range(4, 9)) if COMPILED else (2**6, range(2, 5))
    y, dW = at_rest(), np.sqrt(1 / finest) * normals(generator, model, finest)
    finals = {
        (name, n): go(kind(eps, rule), model, 1 / n, summed(dW, finest // n), y)[0]
        for name, (kind, rule) in zip(NAMES, PAIRS, strict=True)
        for n in [finest, *(2**p for p in powers)]
    }
    h = 2.0 ** -np.array(powers)
    for name in NAMES:
        errors = [mean_square_distance(finals[name, 2**p], finals["AP midpoint", finest]) for p in powers]
        if COMPILED:
            assert 0.9 < slope(h, errors) < 1.15
        assert np.all(np.diff(errors) < 0)
        apart = [mean_square_distance(finals[name, n], finals["AP", n]) for n in (*(2**p for p in powers), finest)]
        if name != "AP":
            assert 0.85 < slope([*h, 1 / finest], apart) < 1.15
    without, _ = go(LIE_TROTTER, model, 1 / finest, dW, y)  # negative control: eps = 0 is another equation
    assert mean_square_distance(without, finals["AP", finest]) > 0.1


def test_the_explicit_scheme_explodes_for_h_above_2_eps_squared(generator):
    eps, y = 0.05, at_rest()
    noise = normals(generator, RIGID_BODY, 400 if COMPILED else 60)

    def after(scheme, u):
        """Steps of size u eps^2."""
        with np.errstate(all="ignore"):
            return go(scheme, RIGID_BODY, u * eps * eps, np.sqrt(u) * eps * noise, y)

    explicit = MultiscaleEuler(eps, EXPLICIT)
    for u in (0.1, 0.9, 1.9):
        _, z = after(explicit, u)
        assert np.abs(z).max() < 6 * eps / np.sqrt(2 - u)  # six standard deviations
    kept, _ = after(explicit, 0.1)
    assert np.abs(np.linalg.norm(kept, axis=0) - 1.0).max() < 0.2
    lost, z = after(explicit, 4.0)  # z triples at each step
    assert np.abs(z).min() > 1e20
    assert not np.isfinite(lost).any()
    for rule in (IMPLICIT, MIDPOINT):
        kept, z = after(AsymptoticPreserving(eps, rule), 4.0)
        assert np.abs(np.linalg.norm(kept, axis=0) - 1.0).max() < 1e-13
        assert np.abs(z).max() < 6 * eps / np.sqrt(2)


def test_the_semi_implicit_scheme_becomes_that_of_the_equation_in_itos_sense(generator):
    """Step by step y + h B grad H + sum_k sigma_k f_k dW_k, without the Itô correction."""
    h, y = 0.01, start(generator, RIGID_BODY)
    dW = np.sqrt(h) * normals(generator, RIGID_BODY, 10)
    for steps in range(1, 11):
        read, _ = go(WithoutCorrection(), RIGID_BODY, h, dW[:steps], y)
        assert distance(go(MultiscaleEuler(1e-6, IMPLICIT), RIGID_BODY, h, dW[:steps], y)[0], read).max() < 1e-9
        assert np.array_equal(go(MultiscaleEuler(0.0, IMPLICIT), RIGID_BODY, h, dW[:steps], y)[0], read)
    right, _ = go(SCHEMES["euler_maruyama"].record, RIGID_BODY, h, dW, y)
    assert np.median(distance(right, read)) > 1e-2
