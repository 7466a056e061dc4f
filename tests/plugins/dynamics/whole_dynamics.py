"""Whole results of each kind of dynamics, made by hand."""

import numpy as np
from long_results import equilibrium, equilibrium_group, growth, growth_group
from strong_results import strong_group

from spi.plugins.dynamics.kinds.equilibrium.results import DerivedQuantities
from spi.plugins.dynamics.kinds.lyapunov.results import Exponents
from spi.plugins.dynamics.kinds.statistics.results import Quantiles, Statistics, TimeCorrelations
from spi.storage import StoredResults
from spi.storage.stored import Description

TIMES = ("correlation", "integral", "spectrum")
HALF = np.array([[[1.0], [1.75]]])
MEANS = Statistics(
    about=Description.of(strong_group("splitting")),
    functions=("phi",),
    texts=("y1",),
    t=np.array([0.0, 1.0]),
    mean=np.array([[1.0, 2.0]]),
    mean_stderr=np.array([[0.0, 0.5]]),
    band=np.array([2.0]),
    variance=np.array([[0.0, 3.0]]),
    variance_stderr=np.array([[0.0, 0.25]]),
    reference=np.array([[1.0, 1.5]]),
    quantiles=Quantiles(level=np.array([0.5]), **dict.fromkeys(("quantile", "quantile_low", "quantile_high"), HALF)),
    autocorrelation=np.array([[np.nan, 1.0]]),
    autocorrelation_stderr=np.array([[np.nan, 0.0]]),
    since=np.ones(1),
    difference=np.array([[0.0, 0.3]]),
    difference_stderr=np.array([[0.1, 0.1]]),
    time=TimeCorrelations(
        lag=np.array([0.0, 1.0]),
        omega=np.array([0.0, 2.0]),
        **{f"{name}{end}": np.array([[2.0, 3.0]]) for name in TIMES for end in ("", "_stderr")},
        **{f"{name}{end}": np.array([2.0]) for name in ("rate", "frequency") for end in ("", "_stderr", "_half")},
    ),
    finite=np.ones((1, 2)),
    nonfinite=0,
    step=0.5,
    samples=10,
    ns_per_step=1.0,
)
EXPONENTS = Exponents(
    about=Description.of(strong_group("splitting")),
    number=np.array([1, 2]),
    t=np.array([1.0]),
    exponent=np.array([[1.0], [-3.0]]),
    exponent_stderr=np.full((2, 1), 0.5),
    total=np.array([-2.0]),
    total_stderr=np.array([0.25]),
    dimension_stderr=0.1,
    change=2.0,
    nonfinite=0,
    step=0.5,
    samples=10,
    ns_per_step=1.0,
)
DERIVED = DerivedQuantities(
    quantities=("q",), formulas=("H^2",), value=np.full((3, 1), 2.0), stderr=np.full((3, 1), 0.1)
)
WHOLE = {
    "growth": growth(*map(growth_group, ("splitting", "midpoint"))),
    "equilibrium": equilibrium(equilibrium_group("splitting", DERIVED)),
    "statistics": StoredResults({"kind": "statistics", "title": "Means"}, (MEANS.group(),)),
    "lyapunov": StoredResults({"kind": "lyapunov", "title": "Exponents"}, (EXPONENTS.group(),)),
}
