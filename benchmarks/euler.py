"""Euler's equations on the torus by a pseudo-spectral method, beside paths of `zeitlin`, whose limit they are.

    spi run experiments/vortex_merger.yaml
    python benchmarks/euler.py results/vortex_merger.h5 [POINTS]

Of the trajectories in a results file those without noise and with the bracket of Zeitlin are taken, and those with the
same vorticity at the start go together.  From that of the largest N Euler's equations are solved on a grid of POINTS a
side, 256 if it is left out: products on the grid, derivatives of Fourier series, a filter exp(-36 (2 m / POINTS)^36) in
place of cutting them off, and the classical Runge-Kutta scheme.  At the times that the experiment draws are printed

    error    the root mean square of the difference to Euler, relative to that of the vorticity, and its order in N
    lowest, highest    value of the vorticity, which a fluid keeps
    C_k      over the mean of omega^k, at the start
    growth   of the mode (1, 0), over the last third of the time, where it is small at the start

A figure stands beside the results, FILE_euler.png: the fields, or with two times errors and growth rates against N.

Supports: docs/appendix/fluids_euler.md, the distance to Euler's equations.

Short form, after `spi run --profile quick vortex_merger`: results/vortex_merger.quick.h5 32
"""

import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spi import storage, views
from spi.drawing import Figure, as_bytes, page
from spi.plugins.fluids.models.fields import cell, ratios, vorticity

POINTS = 256  # of the grid, a side
LONGEST = 0.02  # step
STABLE = 1.0  # step times the largest frequency; the scheme is stable up to 2.8
SMALL = 1e-3  # of the largest mode: a mode whose growth is told
SAME = 0.05  # of the largest value: by how much starts on two lattices may differ


# ---------------------------------------------------------------------------------------------------------------------
# Euler's equations
# ---------------------------------------------------------------------------------------------------------------------


class Grid:
    """Derivatives and products of real Fourier series on a grid."""

    def __init__(self, points):
        self.points = points
        self.m1 = np.fft.fftfreq(points, 1 / points)[:, np.newaxis]
        self.m2 = np.arange(points // 2 + 1.0)[np.newaxis]
        squares = self.m1**2 + self.m2**2
        self.inverse = np.divide(1.0, squares, out=np.zeros_like(squares), where=squares > 0)
        self.filter = np.exp(-36 * (np.maximum(np.abs(self.m1), self.m2) / (points / 2)) ** 36)

    def values(self, omega):
        return np.fft.irfft2(omega, s=(self.points, self.points))

    def velocity(self, omega):
        """u with omega' = u . grad omega: the sign of the bracket, see docs/fluids.md."""
        return self.values(1j * self.m2 * self.inverse * omega), self.values(-1j * self.m1 * self.inverse * omega)

    def rate(self, omega):
        u1, u2 = self.velocity(omega)
        return np.fft.rfft2(u1 * self.values(1j * self.m1 * omega) + u2 * self.values(1j * self.m2 * omega))

    def longest_step(self, omega):
        u1, u2 = self.velocity(omega)
        return min(LONGEST, STABLE / (self.points / 2 * (np.abs(u1) + np.abs(u2)).max()))

    def step(self, omega, h):
        a = self.rate(omega)
        b = self.rate(omega + h / 2 * a)
        c = self.rate(omega + h / 2 * b)
        d = self.rate(omega + h * c)
        return self.filter * (omega + h / 6 * (a + 2 * b + 2 * c + d))


def solution(field, times):
    """The fields (times, G, G) that become of a field (G, G) at increasing times."""
    grid, omega, t, found = Grid(len(field)), np.fft.rfft2(field), 0.0, []
    for end in times:
        if end > t:
            steps = math.ceil((end - t) / grid.longest_step(omega))
            for _ in range(steps):
                omega = grid.step(omega, (end - t) / steps)
        t = end
        found.append(grid.values(omega))
    return np.array(found)


def growth(t, amplitudes):
    """The rate at which a mode grows over the last third of the times."""
    late = t >= t[-1] * 2 / 3
    return np.polyfit(t[late], np.log(amplitudes[late]), 1)[0]


# ---------------------------------------------------------------------------------------------------------------------
# Comparison
# ---------------------------------------------------------------------------------------------------------------------


class Compared(NamedTuple):
    """Paths that start alike, and Euler's solution."""

    title: str
    paths: list  #: readings of trajectories, by N
    times: np.ndarray
    fields: list  #: (times, G, G) of each path
    euler: np.ndarray  #: (times, G, G)
    growths: list | None  #: of each path, and of Euler last

    @property
    def sizes(self):
        return [path.place["modes"] for path in self.paths]

    @property
    def errors(self):
        """(paths, times)."""
        size = np.sqrt((self.euler**2).mean((1, 2)))
        return np.array([np.sqrt(((one - self.euler) ** 2).mean((1, 2))) / size for one in self.fields])


def starts(readings, points):
    """The paths without noise, those with the same vorticity at the start together, by N."""
    groups = []
    for one in readings:
        parameters = one.about.parameters
        if not one.place.get("modes") or parameters.get("noise") or parameters.get("normalisation") != "zeitlin":
            continue
        field = vorticity(one.y[0], points)
        for known, group in groups:
            if np.abs(known - field).max() < SAME * np.abs(known).max() and group[0].t[-1] == one.t[-1]:
                group.append(one)
                break
        else:
            groups.append((field, [one]))
    return [sorted(group, key=lambda one: one.place.get("modes")) for _, group in groups]


def compared(paths, points):
    """The comparison of some paths with Euler's solution."""
    last = paths[-1]
    start, times = vorticity(last.y[0], points), last.t[last.shown]
    modes = np.array(
        [np.hypot(one.y[:, 2 * place], one.y[:, 2 * place + 1]) for one in paths for place in [_mode(one)]]
    )
    if grows := bool((modes[:, 0] < SMALL * np.abs(last.y[0]).max()).all() and (modes[:, 0] > 0).all()):
        every = solution(start, last.t)
        euler = every[last.shown]
        amplitude = np.abs(np.fft.fft2(every, norm="forward")[:, 1, 0])
    else:
        euler = solution(start, times)
    rates = [growth(last.t, one) for one in (*modes, amplitude)] if grows else None
    fields = [vorticity(one.y[one.shown], points) for one in paths]
    return Compared(last.about.case_title, paths, times, fields, euler, rates)


def _mode(one):
    """The place of the mode (1, 0): the last of its row, see ``spi/plugins/fluids/models/tables.py``."""
    return one.place.get("modes") // 2 - 1


def told(found):
    """The lines that are printed of a comparison."""
    yield f"start as in: {found.title}; Euler on {len(found.euler[0])} points a side"
    yield "   N  cell      t     error  order   lowest  highest  C_2, ..., C_5 at the start / mean of omega^k"
    for i, (path, fields) in enumerate(zip(found.paths, found.fields, strict=True)):
        n, known = (
            path.place["modes"],
            ", ".join(f"{one:.3f}" for one in ratios(path.y[0], min(4, path.place["modes"] - 1))),
        )
        for k, t in enumerate(found.times.tolist()):
            error, order = found.errors[i, k], ""
            if i and k and (other := found.sizes[i - 1]) < n:
                order = f"{math.log(found.errors[i - 1, k] / error) / math.log(n / other):.2f}"
            ends = f"{fields[k].min():8.3f} {fields[k].max():8.3f}"
            yield f"{n:4d} {cell(n):5.2f} {t:6.2f} {error:9.3g} {order:>6} {ends}  {'' if k else known}"
    for t, field in zip(found.times.tolist(), found.euler, strict=True):
        yield f"Euler      {t:6.2f} {'':16} {field.min():8.3f} {field.max():8.3f}"
    if found.growths:
        each = [f"{rate:.5f} (N = {n})" for n, rate in zip(found.sizes, found.growths, strict=False)]
        yield f"growth of the mode (1, 0): {', '.join(each)}, {found.growths[-1]:.5f} (Euler)"


def drawn(groups):
    """The figure of all comparisons."""
    if len(groups[0].times) > 2:
        return _fields(groups[0])
    fig = Figure(figsize=(8.2, 3.6), layout="constrained")
    left, right = fig.subplots(1, 2)
    for one in groups:
        n = np.array(one.sizes, float)
        if one.growths:
            right.plot(n, one.growths[:-1], "D", mfc="none", color="#009E73", label="truncation")
            right.axhline(one.growths[-1], color="black", label="Euler")
        else:
            left.loglog(n, one.errors[:, -1], "D", mfc="none", color="#009E73", label=f"$t = {one.times[-1]:g}$")
            left.loglog(n, one.errors[-1, -1] * (n / n[-1]) ** -2, color="#777777", dashes=(4, 2), label="slope $-2$")
    left.set(xlabel="$N$", ylabel=r"$\|\omega_N - \omega\| / \|\omega\|$")
    right.set(xlabel="$N$", ylabel="growth rate of the mode (1, 0)")
    for ax, title in ((left, "(a) smooth vorticity, difference to Euler"), (right, "(b) wave on a Kolmogorov flow")):
        ax.set_title(title, loc="left")
        ax.grid(True, color="#e6e6e6", linewidth=0.6)
        if ax.lines:
            ax.legend(frameon=False)
    return fig


def _fields(one):
    """The fields of each N and of Euler at all times."""
    rows = [*zip([f"$N = {n}$" for n in one.sizes], one.fields, strict=True), ("Euler", one.euler)]
    fig = Figure(figsize=(1.0 + 2.0 * len(one.times), 0.6 + 2.0 * len(rows)), layout="constrained")
    axes = fig.subplots(len(rows), len(one.times), squeeze=False)
    largest = np.abs(one.euler).max()
    look = {"origin": "lower", "cmap": "RdBu_r", "vmin": -largest, "vmax": largest, "extent": (0, 2 * np.pi) * 2}
    for row, (line, (name, fields)) in enumerate(zip(axes, rows, strict=True)):
        for ax, field, t in zip(line, fields, one.times.tolist(), strict=True):
            image = ax.imshow(field.T, **look)
            ax.set(xticks=[], yticks=[], title="" if row else f"$t = {t:g}$")
        line[0].set_ylabel(name)
    fig.colorbar(image, ax=axes, label=r"vorticity $\omega$", shrink=0.6)
    return fig


def main(path, points=POINTS):
    """Print all comparisons of a results file, and draw them."""
    groups = [compared(paths, int(points)) for paths in starts(views.readings(storage.read(path)), int(points))]
    if not groups:
        sys.exit(f"{path}: has no path of zeitlin without noise and with normalisation: zeitlin")
    for found in groups:
        print("\n".join(told(found)), end="\n\n")
    target = Path(path).with_name(f"{Path(path).stem}_euler.png")
    with page.applied():
        target.write_bytes(as_bytes(drawn(groups), "png", dpi=150))
    print(f"wrote {target}")


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
