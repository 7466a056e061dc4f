"""Laws of initial states that dynamics keep.

initial: {law: uniform_on_surface, through: [0, 0, 1]}
initial: {law: gibbs, through: [0, 0, 1], temperature: 0.2}
"""

from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le

from spi.compiler.dispatch import answers
from spi.ensemble.long_states import LONG
from spi.ensemble.protocol import gibbs_law, large
from spi.ensemble.random_states import LongRandomState, RandomState, Spheres
from spi.models.delegation import depends_on_time, undamped
from spi.plugins.dynamics.ensemble.laws import Gibbs, Uniform
from spi.plugins.dynamics.exact.energies import least_on, quadratic
from spi.specs.files import Files
from spi.specs.initial import Law, surface_through
from spi.specs.keys import ABSENT, StateKey, key_of, quantity, wrong

LEAST_ACCEPTANCE = 1e-3  #: of the attempts at a state, with which a law is still drawn
_TRIALS = 2**16  # states by which it is estimated


class OnSurface(Law):
    """Uniform on a Casimir surface."""

    law: Literal["uniform_on_surface"]
    through: key_of(StateKey, "a state on the Casimir surface")

    def state(self, model: Any, files: Files) -> RandomState:
        """A typical state, and the law."""
        surface = surface_through(model, self.through, "through")
        return RandomState(surface.typical, Uniform(surface), self.model_dump())


class OfGibbs(Law):
    """Density exp(-H/T) on a Casimir surface."""

    law: Literal["gibbs"]
    through: key_of(StateKey, "a state on the Casimir surface; not for lattices") = ABSENT
    temperature: key_of(float, "T in the density exp(-H/T); may be negative", "energy")
    sweeps: key_of(
        Annotated[int, Ge(1), Le(10**7)], "of lattices: sweeps over the lattice by which a state is drawn"
    ) = ABSENT

    def state(self, model: Any, files: Files) -> Any:
        """A typical state, and the law."""
        if not self.temperature:
            raise wrong("is 0", "must not be", "temperature")
        if large(model) and depends_on_time(model):
            right = "give a state, or end a run without t in the model and continue it by results"
            raise wrong("is 'gibbs', which is of an H that does not depend on time", right, "law")
        own, other = ("sweeps", "through") if answers(gibbs_law, model) else ("through", "sweeps")
        if other in self.model_fields_set:
            raise wrong(f"is not for the model {type(model).__qualname__}", f"leave it out, or give {own}", other)
        return self._of_model(model) if answers(gibbs_law, model) else self._on_surface(model)

    def _of_model(self, model: Any) -> Any:
        sampled = model.gibbs_law(self.temperature, self.sweeps)
        start = sampled.states(np.random.default_rng(1).standard_normal((sampled.numbers, 1)))[:, 0]
        given = self.model_dump(exclude={"through"}) | {"sweeps": sampled.sweeps}
        if len(start) > LONG:
            return LongRandomState(start, sampled, given)
        return RandomState(tuple(start.tolist()), sampled, given)

    def _on_surface(self, model: Any) -> RandomState:
        if self.through is None:
            raise wrong("missing key 'through'", "add through: a state on the Casimir surface", "through")
        surface = surface_through(model, self.through, "through")
        polynomial = quadratic(model)
        if polynomial is None:
            right = "draw states elsewhere, and give them by law: points"
            raise wrong("is 'gibbs', which is drawn where H is a quadratic polynomial", right, "law")
        _, b, matrix = (part / self.temperature for part in polynomial)
        terms: list[tuple] = [(i, float(c)) for i, c in enumerate(b) if c]
        for i, j in np.argwhere(np.triu(matrix)).tolist():
            terms.append((i, j, float(matrix[i, j] if i < j else 0.5 * matrix[i, i])))
        law = Gibbs(surface, tuple(terms), least_on(surface, b, matrix))
        rate = float(np.exp(law.least - law.energy(_trials(surface))).mean())
        if rate < LEAST_ACCEPTANCE:
            fault = (
                f"is {quantity(self.temperature)}, at which about {rate:.1g} of the attempts at a state are accepted"
            )
            right = f"must be so far from 0 that {LEAST_ACCEPTANCE:g} are; or give states of your own by law: points"
            raise wrong(fault, right, "temperature")
        return RandomState(surface.typical, law, self.model_dump(exclude={"sweeps"}))

    def is_for(self, model: Any) -> bool:
        """See :class:`Law`: also for a large model that draws its states."""
        return super().is_for(model) or answers(gibbs_law, undamped(model))


@lru_cache(1)  # the cases of a sweep often share it
def _trials(surface: Spheres) -> Any:
    """States of the uniform law on a surface."""
    return surface.onto(np.random.default_rng(2).standard_normal((len(surface.point), _TRIALS)))
