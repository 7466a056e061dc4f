"""Systems written in YAML with terms that have no exact flow: what is found, what runs, what is refused and how."""

import pytest
import sympy
from yaml_cases import commutators, definition, heisenberg, made, product, rigid

from spi.checks.model_checks import check_model
from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import cross_product, lie_poisson
from spi.ensemble.protocol import (
    commuting_noises,
    flows_lacking,
    inexact_noises,
    inexact_pieces,
    inner,
    pieces,
    structure_is_kept,
)
from spi.plugins.systems.brackets import merged_powers
from spi.plugins.systems.definition import make
from spi.specs import SpecError

Q, P = "'q(i) for i = 1..n'", "'p(i) for i = 1..n'"
CANONICAL = f"algebra: heisenberg(n), variables: [{Q}, {P}, z]"
#: name -> (definition, its bracket, (pieces, those without a flow), noises without a flow)
SYSTEMS = {
    "a mass that varies": (
        "{algebra: heisenberg, variables: [q, p, z], hamiltonian: p^2/(1 + q^2)/2 + q^4/4, noises: [q, p*sin(q)]}",
        heisenberg(1),
        (2, (1,)),
        (1,),
    ),
    "landmarks": (
        f"{{sizes: {{n: 2}}, {CANONICAL}, noises: ['p(i)*exp(-q(i)^2) for i = 1..n'],"
        " hamiltonian: 'sum(p(i)*p(j)*exp(-(q(i) - q(j))^2) for i = 1..n, j = 1..n)/2'}",
        heisenberg(2),
        (2, (1,)),
        (0, 1),
    ),
    "peakons": (
        f"{{sizes: {{n: 3}}, {CANONICAL}, parameters: {{a: 1/2}},"
        " hamiltonian: 'sum(p(i)*p(j)*exp(-abs(q(i) - q(j))/a) for i = 1..n, j = 1..n)/2', noises: []}",
        heisenberg(3),
        (2, (1,)),
        (),
    ),
    "a rigid body with a strange energy": (
        "{algebra: so(3), parameters: {a: 2}, hamiltonian: a*(y1^2/2 + cos(y1*y2)) + y2^2/3,"
        " noises: [sin(y1*y3), y2], inner: midpoint}",
        commutators(rigid()),
        (3, (2,)),
        (0,),
    ),
    "a spin in a cavity": (
        "{algebra: so(3) * heisenberg, variables: [s1, s2, s3, q, p, i], inner: munthe_kaas,"
        " hamiltonian: s3 + (q^2 + p^2)/2 + cos(q)*s1*p, noises: ['s1*exp(-p^2)*q', s3]}",
        product(commutators(rigid()), heisenberg(1)),
        (2, (1,)),
        (0,),
    ),
}
Y = {
    3: [0.7, -0.4, 1.1],
    5: [0.3, -0.8, 0.6, 1.1, 0.9],
    6: [0.5, 0.8, -0.7, 0.3, 0.9, 1.2],
    7: [0.3, 1.1, -0.6] * 2 + [1],
}


@pytest.fixture(autouse=True)
def plain():
    with uncompiled():
        yield


@pytest.mark.parametrize("name", SYSTEMS)
def test_what_has_no_flow_is_a_piece_of_its_own_or_a_noise(name):
    text, _, (count, lacking), noises = SYSTEMS[name]
    record = made(text).record
    assert (pieces(record), inexact_pieces(record), inexact_noises(record)) == (count, lacking, noises)
    assert inner(record) == definition(text).get("inner", "")
    assert structure_is_kept(record) == ("heisenberg" in text and "so(3)" not in text)
    off = record._replace(sigma=(None,) * len(record.sigma))
    assert flows_lacking(off) == tuple(("pieces", k) for k in lacking)


@pytest.mark.parametrize("name", SYSTEMS)
def test_they_pass_the_generic_checks_and_wrong_ones_do_not(name):
    system = made(SYSTEMS[name][0])
    y = tuple(map(float, Y[len(system.system.world.variables)]))
    assert check_model(system.record, [y], written=False) == []
    # negative controls: a gradient, and a Hessian
    head, _, body = system.text.partition("def piece_gradient")
    value, _, rest = body.partition("return (")
    wrong = system.with_text(f"{head}def piece_gradient{value}return (1e-3 + {rest}")
    assert "drift_flow: its derivatives" in check_model(wrong, [y], written=False)[0]
    head, _, body = system.text.partition("def piece_hessian")
    value, _, rest = body.partition("return (")
    wrong = system.with_text(f"{head}def piece_hessian{value}return (1e-3 * v[0] + {rest}")
    assert "piece_hessian" in check_model(wrong, [y], written=False)[0]


def test_noises_without_flows_that_commute_are_known():
    """Those of landmarks that depend on different particles; not a noise that depends on both."""
    assert commuting_noises(made(SYSTEMS["landmarks"][0]).record) == ((0, 1),)
    assert commuting_noises(made(SYSTEMS["a mass that varies"][0]).record) == ()


def test_the_report_says_which_and_why():
    text = SYSTEMS["a mass that varies"][0]
    lines = make(definition(text), "x")[3]
    why = "no exact flow, as 'p^2/(2*(q^2 + 1))' depends on q and p, which do not commute"
    assert f"flow 2: p^2/(2*(q^2 + 1)): {why}" in lines
    assert "noise 1: q: a shear" in lines and lines[-2].startswith("compositions of flows need inner: midpoint or")
    with_inner = make(definition(text.replace("noises", "inner: midpoint, noises")), "x")[3]
    assert f"flow 2: p^2/(2*(q^2 + 1)): {why}; by the implicit midpoint rule" in with_inner
    assert not any("compositions" in line for line in with_inner)
    (line,) = [
        line
        for line in make(definition("{algebra: so(3), hamiltonian: y1, inner: midpoint}"), "x")[3]
        if "inner" in line
    ]
    assert line == "inner: midpoint is not needed, all flows are exact"


def test_terms_of_double_sums_are_merged():
    """(q(2) - q(1))^2 is (q(1) - q(2))^2; an odd power is another."""
    (a, b), text = sympy.symbols("a b", real=True), made(SYSTEMS["landmarks"][0]).text
    assert merged_powers(sympy.exp((b - a) ** 2) + sympy.exp((a - b) ** 2)) == 2 * sympy.exp((a - b) ** 2)
    assert merged_powers((b - a) ** 3 + (a - b) ** 3) == (b - a) ** 3 + (a - b) ** 3
    assert text.partition("def piece_hessian")[2].partition("def ")[0].count("exp(") == 1


def test_so_3_is_known_by_its_bracket():
    for text, is_so_3 in (
        ("{algebra: so(3), hamiltonian: y1}", True),
        ("{algebra: 'so(2,1)', hamiltonian: y1}", False),
        ("{variables: [y1, y2, y3, l], bracket: {y1 y2: -y3, y2 y3: -y1, y3 y1: -y2}, hamiltonian: y1^2 + l^2}", False),
        ("{variables: [y1, y2, y3, l], bracket: {y1 y2: -y3, y1 y3: y2}, hamiltonian: y1^2 + l^2}", False),
    ):
        found = made(text)
        assert cross_product(found.record) == is_so_3 and lie_poisson(found.record)
        assert "axis_inertias" not in found.text and "rotation_shear_rates" not in found.text


SPEC = """\
kind: strong
model:
  algebra: heisenberg
  variables: [q, p, z]
  hamiltonian: p^2/(1 + q^2)/2 + q^2/2
  noises: [q, p*sin(q)]
initial: [1, 0.5, 1]
final_time: 1
steps: 2^-4 .. 2^-6
reference_step: 2^-9
schemes: [euler_maruyama, munthe_kaas_midpoint]
samples: 100
"""


def test_specs_refuse_what_needs_flows_and_nothing_else(spec):
    able = "euler_maruyama, midpoint, munthe_kaas_euler, munthe_kaas_midpoint, munthe_kaas_areas, roessler_rs2"
    assert spec(SPEC).cases[0].schemes == ("euler_maruyama", "munthe_kaas_midpoint")
    with pytest.raises(SpecError) as error:
        spec(SPEC.replace("[euler_maruyama,", "[splitting,"))
    assert str(error.value) == (
        "s.yaml:11: schemes: has 'splitting', made of exact flows, and none is known of 'p^2/(2*(q^2 + 1))': it depends"
        f" on q and p, which do not commute; add inner: midpoint (or munthe_kaas) to the model, or use {able}"
    )
    with pytest.raises(SpecError) as error:  # splitting_metropolis needs flows as well
        spec(SPEC.replace("[euler_maruyama,", "[splitting,") + "temperature: 1\n")
    assert str(error.value).endswith(f"or use {able}")
    own = "compositions: {mine: [noise 1/2, drift 1, noise 1/2]}\n"
    for old, new in (("[euler_maruyama,", "[mine,"), ("samples", "reference_scheme: splitting_order2\nsamples")):
        with pytest.raises(SpecError, match="made of exact flows"):
            spec(own + SPEC.replace(old, new))
    # of a noise that is off no flow is needed
    exact = SPEC.replace("p^2/(1 + q^2)/2", "p^2/2").replace("[euler_maruyama,", "[splitting,")
    with pytest.raises(SpecError, match=r"none is known of 'p\*sin\(q\)'"):
        spec(exact)
    assert spec(exact.replace("initial", "  sigma: [1, 0]\ninitial")).cases[0].schemes[0] == "splitting"
