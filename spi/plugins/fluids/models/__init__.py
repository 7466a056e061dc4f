"""Stochastic sine-Euler equations for any odd N: Zeitlin's truncation of an ideal fluid on the torus.

The vorticity omega(x) = sum_m omega_m exp(i m.x) on [0, 2 pi)^2 has the modes of ``tables.py``, and (the paper's
Example 4, for every N = 2M + 1)

    B_{m,n} = c sin(2 pi (m x n) / N) omega_{m+n},    H = 1/2 sum_{m != 0} |omega_m|^2 / |m|^2,

with c = 1 as in the paper, or c = N / (2 pi) as in Zeitlin (Physica D 49, 1991).  With the latter they tend to those of
Euler as N grows, in the form omega' = + u . grad omega with curl u = omega: positive vorticity turns clockwise.  With
the paper's c they are slower by the factor 2 pi / N.
"""

from collections import Counter
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Le

from spi.numerics.rng import MOST_NOISES

from .kernels import ns_of_a_line, tables
from .observables import observables_of
from .tables import Mode, lines, modes, shell


class Process(NamedTuple):
    """One Wiener process and its Hamiltonian."""

    mode: Mode
    sigma: float
    form: Literal["quadratic", "cosine", "sine"]  #: |omega_m|^2 / |m|^2, sqrt(2) Re omega_m / |m|, with Im likewise


class ModeNoise(NamedTuple):
    """Noise of some modes: each has Wiener processes of its own.

    quadratic: one process per mode m with Ĥ = |omega_m|^2 / |m|^2, as in the paper.  linear: two processes, with
    Ĥ = sqrt(2) Re omega_m / |m| and sqrt(2) Im omega_m / |m|: transport by given fields of root mean square speed 1.
    The mode -m may be given instead of m: it is the same noise, expressed by the mode that is in the state.
    """

    sigma: Annotated[float, Ge(0), "strength of the noise; 0 switches it off"]
    shell: Annotated[int | None, "all modes with |m| rounded to this"] = None
    modes: Annotated[tuple[tuple[int, int], ...], "a list of modes such as [[1, 0], [2, 1]]"] = ()
    hamiltonian: Annotated[Literal["quadratic", "linear"], "quadratic, as in the paper, or linear, transport"] = (
        "quadratic"
    )

    def __str__(noise):
        where = f"shell {noise.shell}" if noise.shell is not None else f"modes {', '.join(map(str, noise.modes))}"
        return f"{noise.hamiltonian}, {noise.sigma:g} on {where}"


class Zeitlin(NamedTuple):
    """A two-dimensional ideal fluid of N^2 - 1 real components, with Casimirs C_k = tr W^k / N, k = 2, 3, ...

    A passive tracer has as many components and Casimirs: a matrix that the flows turn as they turn W.  Particles have
    two components each: x_1 of all stand after the vorticity and the tracers, then x_2 of all.
    """

    n: Annotated[int, Ge(3), Le(255), "N, odd: the modes are those of the torus modulo N"]
    noise: Annotated[tuple[ModeNoise, ...], "noise of modes or shells, as in {shell: 2, sigma: 0.1}, or a list"] = ()
    normalisation: Annotated[Literal["paper", "zeitlin"], "of the bracket: with 1, or with N / (2 pi)"] = "paper"
    casimirs_watched: Annotated[int, Ge(1), Le(16), "how many Casimirs are watched, from C_2 on"] = 4
    tracers: Annotated[int, Ge(0), Le(8), "passive tracers, which the fluid carries along, after the vorticity"] = 0
    particles: Annotated[int, Ge(0), Le(10_000), "particles, which the fluid carries along, after the tracers"] = 0

    large = True
    symbols = {"n": "N", "casimirs_watched": "", "tracers": "", "particles": ""}  # noqa: RUF012

    def dimension(model):
        return (1 + model.tracers) * (model.n**2 - 1) + 2 * model.particles

    def pieces(model):
        return len(lines(model.n))

    def noises(model):
        return len(model.processes)

    def conserved(model):
        return (1 + model.tracers) * min(model.casimirs_watched, model.n - 1)

    def flow_ns(model):
        return ns_of_a_line(model.n, 1 + model.tracers, model.particles)

    def report(model, initial):
        from .fields import report  # which needs this class

        return report(model, initial)

    def geometry(model):
        carried = {"tracers": model.tracers, "particles": model.particles}
        return {"on": "torus", "modes": model.n} | {key: count for key, count in carried.items() if count}

    def parameters(model):
        """All fields, tracers and particles where there are some."""
        return {key: x for key, x in model._asdict().items() if key not in ("tracers", "particles") or x}

    def observables(model):
        return observables_of(model.n, model.tracers, model.particles)

    def in_kernels(model):
        return tables(model)

    def fault(model):
        if model.n % 2 == 0:
            return "n", f"is {model.n}", f"must be odd, such as {model.n + 1}"
        half = model.n // 2
        for noise in model.noise:
            if (noise.shell is None) == (not noise.modes):
                return "noise", "has an entry with both or none of shell and modes", "give one of them"
            for m1, m2 in noise.modes:
                if (m1, m2) == (0, 0) or max(abs(m1), abs(m2)) > half:
                    return "noise", f"has the mode [{m1}, {m2}]", f"must have modes from -{half} to {half}, not [0, 0]"
            if not _modes_of(noise, model.n):
                shells = max(map(shell, modes(model.n)))
                return "noise", f"has the shell {noise.shell}, which has no modes", f"must be from 1 to {shells}"
        twice = Counter((process.mode, process.form) for process in model.processes).most_common(1)
        if twice and twice[0][1] > 1:
            ((mode, _), _) = twice[0]
            return "noise", f"has the mode [{mode[0]}, {mode[1]}] twice", "add up the squares of the strengths instead"
        if len(model.processes) > MOST_NOISES:
            return "noise", f"has {len(model.processes)} Wiener processes", f"at most {MOST_NOISES} are possible"
        return None

    @property
    def processes(model) -> tuple[Process, ...]:
        """Wiener processes in their order."""
        forms = {"quadratic": ("quadratic",), "linear": ("cosine", "sine")}
        return tuple(
            Process(mode, noise.sigma, form)
            for noise in model.noise
            if noise.sigma > 0
            for mode in _modes_of(noise, model.n)
            for form in forms[noise.hamiltonian]
        )


def _modes_of(noise: ModeNoise, n: int) -> tuple[Mode, ...]:
    """Modes of a noise, one for each pair m, -m; those of a shell in the order of the state."""
    if noise.shell is not None:
        return tuple(m for m in modes(n) if shell(m) == noise.shell)
    stored = set(modes(n))
    return tuple(m if m in stored else (-m[0], -m[1]) for m in noise.modes)
