"""The problem of ``peers.py``, and the peers' schemes for it, in the fastest way found and as documentation shows."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

BODY = {"name": "rigid_body", "inertia": [2, 1, 2 / 3], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
INITIAL = [math.cos(1.1), 0.0, math.sin(1.1)]
EXPONENTS = range(2, 11)  # the step sizes are 2^-k
PATHS = 1024  # for the errors
BATCH = {"diffrax": 1024, "torchsde": 4096}  # paths at once when timed: what is best for each


class Scheme(NamedTuple):
    """A scheme of a peer."""

    program: str
    scheme: str
    final: Callable  #: final(dW): the last states (paths, 3) from increments (steps, 3, paths)
    work: Callable  #: work(n): integrate a batch in n steps


def diffrax_rows():
    """The rows of diffrax; ImportError if it is not installed."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp
    import lineax

    jax.config.update("jax_enable_x64", True)
    initial, batch, key = jnp.array(INITIAL), BATCH["diffrax"], jax.random.key(1)
    inverse, noise_inverse = (1.0 / jnp.array(BODY[i], float) for i in ("inertia", "noise_inertia"))

    class Increments(dfx.AbstractPath):
        dW: jax.Array
        t0, t1 = 0.0, 1.0

        def evaluate(self, t0, t1=None, left=True):
            return self.dW[jnp.rint(t0 * len(self.dW)).astype(int)]

    def cross(a, b):
        return jnp.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

    def drift(t, y, args):
        return cross(y, (inverse * y.T).T)  # y is one state, or has states as columns

    def noise_operator(t, y, args):
        like = jax.ShapeDtypeStruct(y.shape, y.dtype)
        return lineax.FunctionLinearOperator(lambda dW: cross(y, (noise_inverse * y.T).T * dW), like)

    def noise_matrix(t, y, args):
        return jax.vmap(cross, (None, 1), 1)(y, jnp.diag(noise_inverse * y))

    def solve(solver, noise, path, n, y):
        terms = dfx.MultiTerm(dfx.ODETerm(drift), dfx.ControlTerm(noise, path))
        last_only = {"saveat": dfx.SaveAt(t1=True), "max_steps": None, "adjoint": dfx.ForwardMode()}
        return dfx.diffeqsolve(terms, getattr(dfx, solver)(), 0.0, 1.0, 1.0 / n, y, **last_only).ys[0]

    @partial(jax.jit, static_argnums=0)
    def draw(n, key):
        return jax.random.normal(key, (n, 3, batch)) / n**0.5

    @partial(jax.jit, static_argnums=0)
    def tuned(solver, dW):
        return solve(solver, noise_operator, Increments(dW), len(dW), jnp.tile(initial[:, None], dW.shape[-1]))

    @partial(jax.jit, static_argnums=0)
    def plain(n, keys):
        path = partial(dfx.UnsafeBrownianPath, (3,))
        return jax.vmap(lambda key: solve("EulerHeun", noise_matrix, path(key), n, initial))(keys)

    def final(solver, dW):
        return np.asarray(tuned(solver, jnp.asarray(dW))).T

    def work(solver, n):
        tuned(solver, draw(n, key)).block_until_ready()

    def plain_work(n):
        plain(n, jax.random.split(key, batch)).block_until_ready()

    rows = [Scheme("diffrax", s, partial(final, s), partial(work, s)) for s in ("EulerHeun", "Heun", "Midpoint")]
    return [*rows, Scheme("diffrax", "EulerHeun, plain", rows[0].final, plain_work)]


def torchsde_rows():
    """The rows of torchsde; ImportError if it is not installed."""
    import torch
    import torchsde

    real, batch = {"dtype": torch.float64}, BATCH["torchsde"]

    class Plain:
        noise_type, sde_type = "general", "stratonovich"
        inverse, noise_inverse = (1.0 / torch.tensor(BODY[i], **real) for i in ("inertia", "noise_inertia"))

        def f(self, t, y):
            return torch.linalg.cross(y, y * self.inverse)

        def g(self, t, y):
            return torch.linalg.cross(y[:, :, None], torch.diag_embed(y * self.noise_inverse), dim=1)

    class Tuned(Plain):
        def g_prod(self, t, y, dW):
            return torch.linalg.cross(y, y * self.noise_inverse * dW)

    class Increments(torchsde.BaseBrownian):
        dtype, device, levy_area_approximation, shape = torch.float64, torch.device("cpu"), "none", None

        def __init__(self, paths, draw):
            self.shape, self.draw = (paths, 3), draw

        def __call__(self, ta, tb=None, return_U=False, return_A=False):
            return self.draw()

        def __repr__(self):
            return "Increments()"

    @torch.no_grad()
    def solve(system, method, n, paths, draw=None):
        increments = draw and Increments(paths, draw)
        initial = torch.tensor([INITIAL], **real).repeat(paths, 1)
        return torchsde.sdeint(system, initial, torch.tensor([0.0, 1.0], **real), increments, method, 1.0 / n)[-1]

    def final(method, dW):
        rows = iter(torch.from_numpy(dW.transpose(0, 2, 1).copy()))
        return solve(Tuned(), method, len(dW), PATHS, rows.__next__).numpy()

    def work(method, n):
        solve(Tuned(), method, n, batch, lambda: torch.randn(batch, 3, **real).mul_(n**-0.5))

    def plain_work(n):
        solve(Plain(), "euler_heun", n, batch)

    rows = [Scheme("torchsde", s, partial(final, s), partial(work, s)) for s in ("euler_heun", "heun", "midpoint")]
    return [*rows, Scheme("torchsde", "euler_heun, plain", rows[0].final, plain_work)]
