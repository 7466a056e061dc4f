"""What is stored of Lyapunov exponents."""

from typing import Annotated

import numpy as np

from spi.storage.stored import Array, Stored, array, axis, fact


class Exponents(Stored):
    """Lyapunov exponents on the Casimir surface, averaged from the warm-up to several times and over the paths."""

    number: Annotated[Array, axis("number of the exponent, the largest first")]
    t: Annotated[Array, axis("time until which is averaged", "time")]
    exponent: Annotated[Array, array("number t", "Lyapunov exponent", "1/time", formula="E log R_kk / (t - warm_up)")]
    exponent_stderr: Annotated[Array, array("number t", "standard error of the exponent", "1/time")]
    total: Annotated[Array, array("t", "sum of the exponents: mean divergence of the flow", "1/time")]
    total_stderr: Annotated[Array, array("t", "standard error of the sum", "1/time")]
    change: Annotated[float, fact("largest factor, or its inverse, by which a vector changed before it was scaled")]
    nonfinite: Annotated[int, fact("diverged paths (NaN or infinity)")]
    step: Annotated[float, fact("step size", "time")]
    samples: Annotated[int, fact("number of paths", column=True)]
    ns_per_step: Annotated[float, fact("time of a step and path, that of its near paths included", "ns")]

    @property
    def dimension(self) -> float:
        """The Lyapunov dimension j + (lambda_1 + ... + lambda_j) / |lambda_(j+1)|, j the last with a sum of at least 0.

        Kaplan and Yorke's formula; at the last time.
        """
        values = self.exponent[:, -1]
        sums = np.cumsum(values)
        j = int(np.flatnonzero(np.append(sums, -np.inf) < 0.0)[0])
        return j + (sums[j - 1] / abs(values[j]) if 0 < j < len(values) else 0.0)


Record = Exponents
