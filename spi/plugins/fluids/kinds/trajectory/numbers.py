"""Numbers that panels of vorticity show, for tables of exports."""

import numpy as np

from spi.kinds.trajectory.results import Trajectory
from spi.plugins.fluids.models.fields import energy_spectrum, enstrophy
from spi.storage.records import Variables


def part_of(reading: Trajectory, part: int = 0) -> np.ndarray:
    """(times, N^2 - 1): the vorticity, part 0, or a tracer."""
    y = reading.y.reshape(len(reading.y), 1 + reading.place.get("tracers", 0), -1)
    return np.asarray(y[:, part])


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
