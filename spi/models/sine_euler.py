"""Stochastic sine-Euler equations with M = 1, N = 3 (Example 4 and section 4.3): 2-D ideal fluid, truncated.

omega has four independent complex modes, n = (1,0), (1,1), (0,1), (-1,1) in this order, and omega_{-n} is the complex
conjugate; indices are understood modulo 3.  The state is (Re, Im) of the four modes, eight real components.

The flow of H_k leaves omega_k alone.  The other three modes form, some of them conjugated, a line m, m+k, m+2k, on
which z_j = omega_{m+jk} obeys the circulant linear system

    z_j' = (s / |k|^2) (conj(omega_k) z_{j+1} - omega_k z_{j-1}),    s = sin(2 pi (m x k) / 3) = +-sqrt(3)/2.

The 3-point Fourier transform diagonalises it, with the purely imaginary eigenvalues
-2i (s / |k|^2) Im(omega_k w^(-q)), w = exp(2 pi i / 3): a rotation by these angles in each Fourier component.
"""

import math
from typing import Annotated, NamedTuple

from ..compiler.dispatch import device, unrolled
from ..ensemble.protocol import NonNegative, drift_hessian, noise_hessian, structure
from ..numerics.angles import adding_to_zero, sin_versine
from .maxwell_bloch import MaxwellBloch

Strength = NonNegative | None

_S = math.sqrt(3.0) / 2.0  # sin(2 pi / 3)
_THIRD = 1.0 / 3.0
# The parts of these beyond double precision: without them the Fourier transform is not quite unitary and the Casimirs
# drift by 2e-18 a step.
_S_REST, _THIRD_REST = 5.017542110903451e-17, 1.850371707708594e-17


@device
def _side(x):
    """sqrt(3)/2 x."""
    return _S * x + _S_REST * x


@device
def _third(x):
    """x / 3."""
    return _THIRD * x + _THIRD_REST * x


@device
def _line(k, y):
    """(omega_k, s / |k|^2, z_0, z_1, z_2) as (Re, Im) pairs; see the head of this file."""
    a = (y[0], y[1])
    b = (y[2], y[3])
    c = (y[4], y[5])
    d = (y[6], y[7])
    if k == 0:  # m = (0,1)
        return a, -_S, c, b, d
    if k == 1:  # m = (1,0); (0,-1) ends the line
        return b, 0.5 * _S, a, d, (c[0], -c[1])
    if k == 2:  # m = (1,0); (1,-1) ends the line
        return c, _S, a, b, (d[0], -d[1])
    return d, 0.5 * _S, a, c, (b[0], -b[1])  # m = (1,0); (-1,-1) ends the line


@device
def _unline(k, w, z0, z1, z2):
    """State with these modes on the line of k."""
    if k == 0:
        return w[0], w[1], z1[0], z1[1], z0[0], z0[1], z2[0], z2[1]
    if k == 1:
        return z0[0], z0[1], w[0], w[1], z2[0], -z2[1], z1[0], z1[1]
    if k == 2:
        return z0[0], z0[1], z1[0], z1[1], w[0], w[1], z2[0], -z2[1]
    return z0[0], z0[1], z2[0], -z2[1], z1[0], z1[1], w[0], w[1]


@device
def _turn(angles, theta, z):
    """(exp(i theta) - 1) z."""
    s, v = sin_versine(angles, theta)
    return -(s * z[1] + v * z[0]), s * z[0] - v * z[1]


@device
def _cross(w, g):
    """w g for complex numbers as pairs."""
    return w[0] * g[0] - w[1] * g[1], w[0] * g[1] + w[1] * g[0]


@unrolled(each="p[i] - q[i]")
def _minus(p, q):
    """p - q."""


@unrolled(each="p[i] + q[i]")
def _plus(p, q):
    """p + q."""


@device
def _column(k, y, v):
    """B(y) v for the part of v on the mode k: the field of H_k, with v/2 in the place of omega_k / |k|^2."""
    _, c, z0, z1, z2 = _line(k, y)
    part, _, _, _, _ = _line(k, v)
    s = 0.5 * _S if c > 0.0 else -0.5 * _S
    g, gc = (s * part[0], s * part[1]), (s * part[0], -s * part[1])
    new0 = _minus(_cross(gc, z1), _cross(g, z2))
    new1 = _minus(_cross(gc, z2), _cross(g, z0))
    new2 = _minus(_cross(gc, z0), _cross(g, z1))
    return _unline(k, (0.0, 0.0), new0, new1, new2)


@device
def _conjugated(y):
    """Complex conjugates of all modes."""
    return y[0], -y[1], y[2], -y[3], y[4], -y[5], y[6], -y[7]


@device
def _squares(y):
    """|omega_k|^2 of the four modes."""
    return (
        y[0] * y[0] + y[1] * y[1],
        y[2] * y[2] + y[3] * y[3],
        y[4] * y[4] + y[5] * y[5],
        y[6] * y[6] + y[7] * y[7],
    )


@device
def _re3(p, q, r):
    """Re(p q r)."""
    u = _cross(p, q)
    return u[0] * r[0] - u[1] * r[1]


class SineEuler(NamedTuple):
    """H = sum_k H_k over the four modes, H_k = Ĥ_k = |omega_k|^2 / |k|^2.

    Casimirs: C_1 = sum_k |omega_k|^2 and the cubic C_2.
    """

    sigma: Annotated[
        tuple[Strength, Strength, Strength, Strength],
        "strengths of the noises of the modes (1,0), (1,1), (0,1), (-1,1); 0 switches one off",
    ] = (1.0, 1.0, 1.0, 1.0)

    dimension = 8
    pieces = 4
    noises = 4
    conserved = 2
    casimir_degrees = (2, 3)
    squared_length_is_casimir = True
    flow_ns = 1.7
    joint_noises = ((0,), (1,), (2,), (3,))
    equation = r"y = \omega, \quad H = \sum_k H_k, \quad H_k = \widehat H_k = \frac{|\omega_k|^2}{|k|^2}"
    complex_modes = (r"\omega", ("(1,0)", "(1,1)", "(0,1)", "(-1,1)"))

    def geometry(model):
        return {"on": "torus", "modes": 3}

    def drift_angle(model, k, t, y):
        """A bound of the three angles, 2 |c t| (|Re omega_k| + |Im omega_k|)."""
        w, c, _, _, _ = _line(k, y)
        return abs(2.0 * c * t) * (abs(w[0]) + abs(w[1]))

    def drift_flow(model, k, t, y, angles):
        w, c, z0, z1, z2 = _line(k, y)
        # angles -2 c t Im(w exp(-2 pi i q / 3)) of the Fourier components q = 0, 1, 2
        f = -2.0 * c * t
        p0 = f * w[1]
        half, side = -0.5 * p0, f * _S * w[0]
        p0, p1, p2 = adding_to_zero(angles, p0, half - side, half + side)
        # Fourier components, 3 times too large: q = 1 and 2 are (z0 - sum/2) -+ i sqrt(3)/2 (z1 - z2) of the line
        sum_re, sum_im = z1[0] + z2[0], z1[1] + z2[1]
        dif_re, dif_im = _side(z1[0] - z2[0]), _side(z1[1] - z2[1])
        mid_re, mid_im = z0[0] - 0.5 * sum_re, z0[1] - 0.5 * sum_im
        u0 = _turn(angles, p0, (z0[0] + sum_re, z0[1] + sum_im))
        u1 = _turn(angles, p1, (mid_re + dif_im, mid_im - dif_re))
        u2 = _turn(angles, p2, (mid_re - dif_im, mid_im + dif_re))
        # and back: the change of z_j is the mean of u_q exp(2 pi i j q / 3)
        sum_re, sum_im = u1[0] + u2[0], u1[1] + u2[1]
        dif_re, dif_im = _side(u1[0] - u2[0]), _side(u1[1] - u2[1])
        mid_re, mid_im = u0[0] - 0.5 * sum_re, u0[1] - 0.5 * sum_im
        new0 = (z0[0] + _third(u0[0] + sum_re), z0[1] + _third(u0[1] + sum_im))
        new1 = (z1[0] + _third(mid_re - dif_im), z1[1] + _third(mid_im + dif_re))
        new2 = (z2[0] + _third(mid_re + dif_im), z2[1] + _third(mid_im - dif_re))
        return _unline(k, w, new0, new1, new2)

    noise_angle, noise_flow = drift_angle, drift_flow  # since Ĥ_k = H_k
    joint_angle, joint_flow = MaxwellBloch.joint_angle, MaxwellBloch.joint_flow

    def structure(model, y, v):
        """B_{m,n} = sin(2 pi (m x n) / 3) omega_{m+n}, applied to the complex gradient (v_Re - i v_Im)/2."""
        return _plus(_plus(_column(0, y, v), _column(1, y, v)), _plus(_column(2, y, v), _column(3, y, v)))

    def lie_bracket(model, v, w):
        """In conjugated modes the commutator is the coadjoint action: the algebra is su(3)."""
        return _conjugated(structure(model, _conjugated(v), _conjugated(w)))

    def noise_structure(model, k, y, v):
        return _column(k, y, v)

    def noise_structure_derivative(model, k, y, u, v):
        return _column(k, u, v)

    def hamiltonian(model, y):
        a, b, c, d = _squares(y)
        return a + 0.5 * b + c + 0.5 * d

    def casimirs(model, y):
        """C_1, and C_2 = 2 Re(sum_k omega_k^3 - 3 (a b d* + a b* c + a c* d + b c d)), the modes being a, b, c, d.

        The latter is the paper's sum over the cell K, collected.
        """
        e = _squares(y)
        a, b, c, d = (y[0], y[1]), (y[2], y[3]), (y[4], y[5]), (y[6], y[7])
        bc, cc, dc = (y[2], -y[3]), (y[4], -y[5]), (y[6], -y[7])
        cubes = _re3(a, a, a) + _re3(b, b, b) + _re3(c, c, c) + _re3(d, d, d)
        mixed = _re3(a, b, dc) + _re3(a, bc, c) + _re3(a, cc, d) + _re3(b, c, d)
        return e[0] + e[1] + e[2] + e[3], 2.0 * cubes - 6.0 * mixed

    def drift_gradient(model, y):
        return drift_hessian(model, y, y)

    def drift_hessian(model, y, v):
        return 2.0 * v[0], 2.0 * v[1], v[2], v[3], 2.0 * v[4], 2.0 * v[5], v[6], v[7]

    def noise_gradient(model, k, y):
        return noise_hessian(model, k, y, y)

    def noise_hessian(model, k, y, v):
        a, b, c, d = (
            2.0 if k == 0 else 0.0,
            1.0 if k == 1 else 0.0,
            2.0 if k == 2 else 0.0,
            1.0 if k == 3 else 0.0,
        )
        return a * v[0], a * v[1], b * v[2], b * v[3], c * v[4], c * v[5], d * v[6], d * v[7]
