"""Numbers that panels of vorticity show, for tables of exports."""

import numpy as np

from spi.kinds.trajectory.results import Trajectory
from spi.plugins.fluids.models.fields import energy_spectrum, enstrophy
from spi.storage.records import Variables


def part_of(reading: Trajectory, part: int = 0) -> np.ndarray:
    """(times, N^2 - 1): the vorticity, part 0, or a tracer."""
    fields = reading.y[:, : reading.y.shape[1] - 2 * reading.place.get("particles", 0)]
    return np.asarray(fields.reshape(len(fields), 1 + reading.place.get("tracers", 0), -1)[:, part])


def places_of(reading: Trajectory) -> np.ndarray:
    """(times, 2, particles): x_1 and x_2 of each, unwrapped."""
    count = reading.place.get("particles", 0)
    return np.asarray(reading.y[:, reading.y.shape[1] - 2 * count :].reshape(-1, 2, count))


def particles(reading: Trajectory) -> Variables:
    """``x1`` and ``x2`` of each particle at all times, unwrapped."""
    x = places_of(reading)
    coordinates: Variables = {"particle": (("particle",), np.arange(1, x.shape[2] + 1))}
    return coordinates | {f"x{a + 1}": (("t", "particle"), x[:, a]) for a in (0, 1)}


def spectra(reading: Trajectory) -> Variables:
    """``energy_spectrum`` E(k) at the times that are drawn, over ``spectrum_t`` and the wave numbers ``k``."""
    energies = spectra_of(reading)
    axes = {"spectrum_t": reading.t[reading.shown], "k": np.arange(1, energies.shape[1] + 1)}
    coordinates: Variables = {name: ((name,), values) for name, values in axes.items()}
    return coordinates | {"energy_spectrum": (tuple(axes), energies)}


def spectra_of(reading: Trajectory) -> np.ndarray:
    """(times, shells) the energy of each shell at the chosen times."""
    with np.errstate(all="ignore"):
        return energy_spectrum(part_of(reading)[reading.shown])


def enstrophies(reading: Trajectory) -> Variables:
    """``enstrophy`` at all times."""
    with np.errstate(all="ignore"):
        return {"enstrophy": (("t",), enstrophy(part_of(reading)))}
