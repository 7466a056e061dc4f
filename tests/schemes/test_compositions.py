"""Steps of the splitting schemes for every model, and their compositions as data."""

import numpy as np
import pytest
import scheme_cases
from helpers import LANES, ONE_NOISE, RIGID_BODY, SCHEMES, random_states, take_step, take_steps
from scheme_cases import ANGLE, LOCKED, relative, tosses

from spi.ensemble.protocol import (
    dimension,
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_indices,
    noises,
    pieces,
)
from spi.models import LotkaVolterra, MaxwellBloch, RigidBody, SineEuler
from spi.numerics.angles import ANY_ANGLES
from spi.numerics.elementary import SMALL
from spi.schemes.splitting import LIE_TROTTER, ORDER_2
from spi.schemes.stages import compositions

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model


SYSTEMS = {
    "rigid_body": RIGID_BODY,
    "rigid_body_two_noises": RIGID_BODY._replace(sigma=(0.7, None, 1.2)),
    "rigid_body_one_noise": ONE_NOISE,
    "rigid_body_no_noise": RIGID_BODY._replace(sigma=(None, None, None)),
    "maxwell_bloch": MaxwellBloch((0.5, 1.5)),
    "lotka_volterra": LotkaVolterra((0.3,)),
    "sine_euler": SineEuler((0.5, 0.2, None, 0.4)),
}


def order_2_printed(model, h, dW, coin, y):
    """The remark rem:order2 for one path, with the model's own flows, which other tests check."""
    last, on = pieces(model) - 1, [k for k, sigma in enumerate(model.sigma) if sigma is not None]

    def half(y):
        for k in range(last):
            y = drift_flow(model, k, h / 4, y, ANY_ANGLES)
        y = drift_flow(model, last, h / 2, y, ANY_ANGLES)
        for k in range(last - 1, -1, -1):
            y = drift_flow(model, k, h / 4, y, ANY_ANGLES)
        return y

    y = half(y)
    for k in on if coin == 1 else on[::-1]:
        y = noise_flow(model, k, model.sigma[k] * dW[k], y, ANY_ANGLES)
    return half(y)


def acted(flows, model, h, dW, y):
    """What a composition, given as data, makes of a state."""
    for kind, k, fraction in flows:
        if kind == "drift":
            y = drift_flow(model, k, fraction * h, y, ANY_ANGLES)
        else:
            y = noise_flow(model, k, fraction * model.sigma[k] * dW[k], y, ANY_ANGLES)
    return y


#: Those of the other systems have kernels that nothing else needs.
ONE_OF_A_SORT = "rigid_body", "rigid_body_two_noises", "maxwell_bloch", "lotka_volterra"


@pytest.fixture(params=[pytest.param(s, marks=[] if s in ONE_OF_A_SORT else pytest.mark.slow) for s in SYSTEMS])
def system(request, generator):
    """A model, states [component, lane] and increments [noise, lane]."""
    model = SYSTEMS[request.param]
    y = random_states(generator, dimension(model))
    if isinstance(model, LotkaVolterra):
        y = np.exp(0.5 * y)
    return model, y, 0.5 * generator.standard_normal((noises(model), LANES))


def largest_angle(scheme, model, h, dW, y, coins):
    """The largest |angle| of all flows of one step of a block, by one lane and one flow after the other."""
    found, as_data = [0.0], compositions(scheme.stages, model)
    for lane in range(LANES):
        state = tuple(y[:, lane].tolist())
        _, flows = as_data[0 if coins[lane] > 0 else -1]
        for kind, k, fraction in flows:
            angle, flow, t = (
                (drift_angle, drift_flow, fraction * h)
                if kind == "drift"
                else (noise_angle, noise_flow, fraction * model.sigma[k] * dW[k, lane])
            )
            found.append(angle(model, k, t, state))
            state = flow(model, k, t, state, ANY_ANGLES)
    return max(found)


def test_largest_angle_is_reported(system, generator):
    """The largest of a step, if it is above pi/4; the largest of all steps."""
    model, y, dW = system
    coins, largest = tosses(generator), []
    for h, strength in ((0.3, 1.0), (2.0, 1.0), (1e-3, 1e-3), (0.3, 0.1)):
        _, report = take_step(ORDER_2, model, h, strength * dW, y, coins)
        expected = largest_angle(ORDER_2, model, h, strength * dW, y, coins)
        largest.append(expected if expected > SMALL else 0.0)
        assert report[ANGLE] == pytest.approx(largest[-1], rel=1e-12, abs=0.0)
        assert not report[:ANGLE].any()
    assert largest[2] == 0.0
    assert (largest[1] > 1.0) == (not isinstance(model, LotkaVolterra))  # which has no angles


@pytest.mark.parametrize("angle", [0.1, np.nextafter(SMALL, 0.0), SMALL, np.nextafter(SMALL, 1.0), 1e7, np.inf, np.nan])
def test_one_angle_is_reported_from_a_quarter_of_pi_on(angle):
    """To the last bit; what is not finite counts as infinite, so that it is not forgotten."""
    model = RigidBody((1.0, LOCKED, LOCKED), (LOCKED, LOCKED, LOCKED))
    y = np.zeros((3, LANES))
    y[0, 40] = -1.0 if np.isfinite(angle) else angle
    with np.errstate(invalid="ignore"):
        _, report = take_steps(LIE_TROTTER, model, angle if np.isfinite(angle) else 1.0, np.zeros((2, 3, LANES)), y)
    assert report[ANGLE] == (0.0 if angle <= SMALL else angle if np.isfinite(angle) else np.inf)
    _, report = take_step(SCHEMES["euler_maruyama"].record, model, 1.0, np.zeros((3, LANES)), y)
    assert report[ANGLE] == 0.0  # it turns nothing


def by_lanes(step, y, dW, coins):
    """The states after step(y, dW, coin) in every lane."""
    return np.transpose([step(tuple(y[:, n].tolist()), dW[:, n].tolist(), coins[n]) for n in range(LANES)])


def test_order_2_is_the_printed_composition_and_so_are_the_compositions_as_data(system, generator):
    model, y, dW = system
    h, coins = 0.3, tosses(generator)
    new, _ = take_step(ORDER_2, model, h, dW, y, coins)
    printed = by_lanes(lambda y, dW, coin: order_2_printed(model, h, dW, coin, y), y, dW, coins)
    assert relative(new, printed) < 1e-13
    as_data = compositions(ORDER_2.stages, model)
    assert [probability for probability, _ in as_data] == [0.5, 0.5]
    of_coin = {1.0: as_data[0][1], -1.0: as_data[1][1]}
    assert relative(by_lanes(lambda y, dW, coin: acted(of_coin[coin], model, h, dW, y), y, dW, coins), printed) < 1e-14
    if len(noise_indices(model)) > 1:  # negative control: the coins on the other side
        other, _ = take_step(ORDER_2, model, h, dW, y, -coins)
        assert relative(other, printed) > 1e-2
    lie_trotter = compositions(LIE_TROTTER.stages, model)[0][1]
    assert relative(by_lanes(lambda y, dW, coin: acted(lie_trotter, model, h, dW, y), y, dW, coins), printed) > 1e-2


def test_order_2_with_the_coin_turned_is_its_own_inverse(system, generator):
    """Phi_{-h,-coin}(-dW) o Phi_{h,coin}(dW) is the identity: turning the coin reverses the order of all flows."""
    model, y, dW = system
    h, coins = 0.3, tosses(generator)
    new, _ = take_step(ORDER_2, model, h, dW, y, coins)
    back, _ = take_step(ORDER_2, model, -h, -dW, new, -coins)
    assert relative(back, y) < 1e-12
    assert relative(new, y) > 0.1
    if len(noise_indices(model)) > 1:  # negative control
        assert relative(take_step(ORDER_2, model, -h, -dW, new, coins)[0], y) > 1e-2
