"""Cases: the keys that several kinds of experiment have in common, and conditions between them."""

import itertools
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
import pydantic

from ..compiler.dispatch import MOST, answers
from ..ensemble.areas import HOW
from ..ensemble.fields import lie_poisson
from ..ensemble.increments import CLIPPED, RESCALED, UNCLIPPED
from ..ensemble.long_states import LongState
from ..ensemble.protocol import (
    NonNegative,
    Positive,
    at_temperature,
    bath_fault,
    casimir_degrees,
    component_names,
    conserved,
    dimension,
    flows_lacking,
    has_bath,
    has_friction,
    initial_time,
    large,
    named_numbers,
    noise_indices,
    noises,
    one_path,
    parameters,
    squared_length_is_casimir,
)
from ..ensemble.scheme_protocol import judges, needs_areas
from ..exact.surfaces import casimir_form, semidefinite
from ..expressions import as_numpy, canonical, is_constant, parse_expression
from ..expressions.arithmetic import NumberError
from ..expressions.ranges import TAKEN, meaning_of, numbered, written_out
from ..models import MODELS
from ..models.delegation import damped, depends_on_time, thermal, undamped
from ..numerics.rng import MOST_NOISES
from ..schemes import SCHEMES, Scheme, composed, of_model, with_eps
from ..statistics.claims import Claim
from ..storage.stored import Claimed
from .checks import (
    check_count,
    check_distinct,
    check_schemes,
    check_step,
    dyadic,
    wrong_scheme,
)
from .compositions import Compositions, check_steps, weak_order
from .expect import Expect, claims
from .files import Files
from .initial import Initial
from .keys import (
    Eps,
    Functions,
    Keys,
    OrInfinite,
    SchemeName,
    Schemes,
    Seed,
    Steps,
    condition,
    entries_in,
    key_of,
    listed,
    quantity,
    shown,
    suggestion,
    wrong,
)
from .models import Model, check_words, name_of
from .names import CodeKeys, Taken, check_values, named_in, numbers_of
from .noise import NoiseKey
from .sweep import PLACES, SWEEP, SweptKey, check_shown, with_panels

_MOST_DECAY = 600.0  # of the logarithm of a Casimir function, whose smallest values are about exp(-700)
CLIP = (
    "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes; at a temperature they are then divided by the "
    "standard deviation of clipped normal numbers"
)


class FunctionKeys(CodeKeys):
    """Test functions of a case."""

    functions: key_of(
        Functions, "test functions, as in {phi: sin(2*pi*y1) + y2^2, energy: H}, or the text of one named phi"
    ) = pydantic.Field(default_factory=dict)

    if TYPE_CHECKING:  # attributes of every case
        model: Any
        variables: tuple[str, ...]

        @property
        def last_time(self) -> float: ...

    @property
    def expressions(self) -> tuple:
        """Trees of the test functions, in the order of their names."""
        return tuple(map(self._parsed, self.functions.values()))

    def _parsed(self, text: str, names: tuple[str, ...] = ()) -> Any:
        at_end = {"t": initial_time(undamped(self.model)) + self.last_time}
        known = at_end | named_in(text, self.model, self.variables, self.python)
        return parse_expression(text, dimension(self.model), names, known)

    @pydantic.field_serializer("functions")
    def _canonical(self, functions: dict[str, str]) -> Any:
        # pairs, because their order decides that of the results, and in the least text that decides the values
        return [[name, canonical(e)] for name, e in zip(functions, self.expressions, strict=True)]

    @condition
    def _check_functions(self) -> Self:
        trees = {name: self._tree(name, text) for name, text in with_others(self, self.functions).items()}
        if not self.variables and all(map(self._is_plain, self.functions.values())):
            return self
        return self.model_copy(update={"functions": {name: canonical(tree) for name, tree in trees.items()}})

    def _is_plain(self, text: str) -> bool:
        """Whether a text has no words but those of the components."""
        try:
            parse_expression(text, dimension(self.model))
        except NumberError:
            return False
        return True

    def _tree(self, name: str, text: str) -> Any:
        """Tree of a test function."""
        try:
            tree = self._parsed(text, self.variables)
            if is_constant(tree):
                raise NumberError("constant")
            check_values(self, as_numpy(tree))
        except NumberError as error:
            names = listed(self.variables) or f"y1 .. y{min(dimension(self.model), MOST)}"
            example = f"{self.variables[0]}^2" if self.variables else "sin(2*pi*y1) + y2^2"
            right = f"must be an expression in {names} such as {example}"
            raise wrong(f"is {shown(text)} ({error})", right, "functions", name) from None
        return tree


def with_others(case: Any, entries: Mapping[str, Any], key: str = "functions") -> dict[str, Any]:
    """Entries of a key of formulas by name, names of others being their formulas, and ranges one function each.

    A function may be called like what it is, as in {H: H}, but not like something else that formulas can name.
    """
    try:
        entries = numbered(entries, named_numbers(undamped(case.model))) if key == "functions" else entries
    except NumberError as error:
        raise wrong(f"cannot be written out: {error}", "write a range as in {x: x(i) for i = 1..3}", key) from None
    for name, text in entries.items() if key == "functions" else ():
        if name not in TAKEN and (meaning := meaning_of(name)) and str(text).strip() != name:
            raise wrong(f"is called '{name}', {meaning} in formulas", "take another name", "functions", name)
    try:
        return written_out(entries, Taken(case) if key == "functions" else {*numbers_of(case), "t", "T"})
    except NumberError as error:
        raise wrong(f"cannot be written out: {error}", "leave one of these names out", key) from None


class BaseCase(Keys):
    """Keys of all kinds; a spec file gives all fields but the first two."""

    name: str
    title: str
    model: Model
    damping: key_of(NonNegative, "rate gamma of linear damping, the field -gamma y added to the drift", "1/time") = 0.0
    temperature: key_of(OrInfinite, "T of the friction along the noises; inf is no friction", "energy") = math.inf
    initial: key_of(
        Initial,
        "initial value y_0: a number per component, or a complex one such as 0.1+0.3i per mode; a field; or a law",
        "state",
    )
    seed: key_of(Seed, "seed of the random numbers") = 1
    eps: key_of(Eps | None, "scale of the fast processes of the multiscale system, a number or a list of them") = None
    compositions: key_of(Compositions, "custom splitting schemes, as in {mine: [noise 1/2, drift 1, noise 1/2]}") = (
        pydantic.Field(default_factory=dict)
    )
    noise: key_of(NoiseKey, "what drives the noises, as in {kind: brownian}, which is the default") = None
    areas: key_of(Literal[HOW], f"how Lévy areas are drawn: {' or '.join(HOW)}, right in law only") = "exact"
    expect: key_of(Expect, "what must come out, as in {splitting: {order: 1/2}}") = ()
    sweep: key_of(SweptKey, SWEEP) = pydantic.Field(default=None, exclude=True)  # its values are cases of their own

    #: The keys that decide no path of a part: names, numbers of paths, other parts, derived quantities and figures.
    neutral: ClassVar[frozenset[str]] = frozenset(
        ["name", "title", "expect", "schemes", "compositions", "eps", "samples", "panels"]
    )
    #: key -> the value with which it is left out of the data that decide results, as in specs from before it was a key.
    unsaid: ClassVar[Mapping[str, Any]] = {
        "damping": 0.0,
        "temperature": math.inf,
        "noise": None,
        "areas": "exact",
        "python": None,
    }
    #: The keys that only figures and tables read.  They are no part of what identifies results.
    looks: ClassVar[frozenset[str]] = frozenset(["title", "panels"])
    distinct: ClassVar[tuple[str, ...]] = ("panels",)  #: the keys with lists in which nothing may stand twice
    at_once: ClassVar[bool] = True  #: whether all increments of a path may be made at once
    driven: ClassVar[bool] = True  #: whether `noise` may be another process than Brownian motion
    along_paths: ClassVar[bool] = False  #: whether errors are those of given paths, which have areas of their own
    quantities: ClassVar[Mapping[str, Claimed]] = {}  #: by name the quantities that claims may name
    scoping: ClassVar[tuple[str, ...]] = ()  #: the keys whose entries a claim may be restricted to
    swept_in: ClassVar[tuple[str, ...]] = PLACES  #: the keys in which a swept parameter may stand
    most_swept: ClassVar[int] = 2  #: the number of parameters that may be swept at once
    sweeps_quantities: ClassVar[bool] = True  #: whether `panels` of a sweep are quantities
    example: ClassVar[str] = ""  #: keys of a short experiment with the rigid body, for `spi new --kind`
    listed_under: ClassVar[str] = "dynamics"  #: the group of experiments in ``spi list``

    if TYPE_CHECKING:  # a key of every kind, which stands among those that only this kind has
        schemes: tuple[str, ...]

    def row(self, scheme: str, eps: float | None = None) -> Scheme:
        """Entry of a scheme by its name: of a composition of the case, or in the table of schemes."""
        entry = self.compositions.get(scheme) or with_eps(SCHEMES[scheme], eps)
        if not isinstance(entry, Scheme):
            entry = composed(scheme, entry, weak_order(entry, self.model))
        return of_model(entry, self.model)

    def reference_record(self, eps: float | None) -> Any:
        """Record of the scheme that makes the reference of one with this eps; None if each makes its own."""
        name: str | None = getattr(self, "reference_scheme", None)
        return self.row(name, eps or 0.0).record if name else None

    @property
    def schemes_used(self) -> tuple[str, ...]:
        """Schemes, and that of the reference if there is one."""
        name: str | None = getattr(self, "reference_scheme", None)
        return (*self.schemes, name) if name else self.schemes

    @property
    def runs(self) -> list[tuple[str, float | None]]:
        """(scheme, eps or None) of each run: schemes of the multiscale system once for each eps."""
        return [(s, eps) for s in self.schemes for eps in (self.eps if self.row(s).multiscale else [None])]

    @property
    def limiting(self) -> tuple[str, ...]:
        """Names that may limit a claim: h, eps where there is one, and swept parameters."""
        return ("h", *["eps"] * (self.eps is not None), *(self.sweep.parameters if self.sweep else ()))

    @property
    def owner(self) -> str:
        """Name of the case, or of that which is swept if it is one of its values."""
        return (self.sweep and self.sweep.case) or self.name

    @property
    def scopes(self) -> list[str]:
        """Names to which a claim may be restricted: entries of the keys :attr:`scoping`."""
        return [entry for key in self.scoping for entry in getattr(self, key)]

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Claims of ``expect``."""
        return claims(self)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the components; () if the system gives them none."""
        return tuple(component_names(self.model))

    @property
    def clipping(self) -> int:
        """What becomes of increments: friction at a temperature belongs to their variance, which clipping lowers."""
        clipped = RESCALED if math.isfinite(self.temperature) else CLIPPED
        return clipped if getattr(self, "truncate_noise", False) else UNCLIPPED

    @property
    def driver(self) -> str:
        """Process that drives the noises in place of Brownian motion, in words; empty if that does."""
        return self.noise.text if self.noise else ""

    @property
    def laws_shown(self) -> tuple[str, ...]:
        """Panels about a stationary law, which is known without damping and temperature only."""
        return ()

    @property
    def noise_steps(self) -> tuple[float, ...]:
        """Step sizes for which increments are drawn; those of larger steps are sums of them."""
        raise NotImplementedError

    @property
    def wanted_paths(self) -> int:
        """Number of paths whose noise is drawn."""
        return getattr(self, "samples", None) or 1

    def check_driven(self) -> None:
        """Raise the error about what is for Brownian motion, of a case with another driver."""
        if not self.driven:
            raise wrong("is given, but this kind of experiment is for Brownian motion", "leave it out", "noise")
        if getattr(self, "truncate_noise", False):
            raise wrong("is true, whose bound is that for Brownian motion", "leave it out", "truncate_noise")

    @property
    def model_name(self) -> str:
        return name_of(self.model)

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the model by name, and the damping or temperature where there is one."""
        values = dict(parameters(undamped(self.model)))
        for key, value in values.items():
            if hasattr(value, "_fields"):
                values[key] = str(value)
            elif isinstance(value, tuple) and any(hasattr(entry, "_fields") for entry in value):
                values[key] = "; ".join(map(str, value))
        damping = {"damping": self.damping} if self.damping else {}
        return values | damping | ({"temperature": self.temperature} if math.isfinite(self.temperature) else {})

    @property
    def last_time(self) -> float:
        """Time at which the longest paths end."""
        raise NotImplementedError

    @pydantic.model_validator(mode="before")
    @classmethod
    def _read_panels(cls, data: Any) -> Any:
        return with_panels(data, cls.quantities) if cls.sweeps_quantities else data

    @pydantic.model_validator(mode="after")
    def _check_seed(self, info: pydantic.ValidationInfo) -> Self:
        """Case with noise of its own where it begins with the last state of another run."""
        seeds = info.context.seeds if isinstance(info.context, Files) else {}
        taken = seeds and seeds.get(LongState(self.initial).digest)
        if not taken:
            return self
        if "seed" not in self.model_fields_set:
            return self.model_copy(update={"seed": next(seed for seed in itertools.count(1) if seed not in taken)})
        if self.seed in taken:
            fault = f"is {self.seed}, as in the run that initial continues, whose noise would come again"
            raise wrong(fault, "leave it out, or take another number", "seed")
        return self

    @condition
    def _check_dissipation(self) -> Self:
        """Case with its damping or its temperature in the record of the model."""
        return self.model_copy(update={"model": _dissipative(self)})

    @pydantic.model_serializer(mode="wrap")
    def _without_unsaid(self, write: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        left_out = {key for key, value in self.unsaid.items() if getattr(self, key, value) == value}
        return {key: value for key, value in write(self).items() if key not in left_out}

    @condition
    def _check_names(self) -> Self:
        """All schemes are in the table or among the compositions; the case without unused compositions."""
        names = (*SCHEMES, *self.compositions)
        for n, name in enumerate(self.schemes_used):
            if name not in names:
                place = ("schemes", n) if n < len(self.schemes) else ("reference_scheme",)
                raise wrong(f"is {shown(name)}", suggestion(name, names), *place)
        used = {name: rows for name, rows in self.compositions.items() if name in self.schemes_used}
        return self.model_copy(update={"compositions": used})

    @condition
    def _check_initial(self) -> None:
        d, count = dimension(self.model), len(self.initial)
        if count != d:
            raise wrong(f"has {entries_in(count)}", f"must have {d}, the dimension of {self.model_name}", "initial")

    @condition
    def _check_words(self) -> None:
        check_words(self.model, self.initial)
        check_steps(self.compositions, self.model, self.initial)

    @property
    def in_parts(self) -> bool:
        """Whether there is one path only, whose state threads share."""
        return False

    def can_share_one(self, h: float) -> bool:
        """Whether threads can share the state of one path, by the model and all schemes, with steps of size h."""
        if self.driver or getattr(self, "truncate_noise", False) or not answers(one_path, self.model):
            return False
        return all(one_path(self.model, self.row(name).record, h) for name in self.schemes)

    @condition
    def _check_needs(self) -> None:
        """Facts that schemes need hold for the model."""
        if noises(self.model) > MOST_NOISES and not self.in_parts:
            right = (
                f"paths have at most {MOST_NOISES}; one path of a large lattice is for the kind trajectory, and "
                "others with samples: 1, by splittings without coins, splitting_metropolis with by: sites, "
                "and periodic lengths that divide into 64 equal parts"
            )
            if depends_on_time(self.model):
                right = f"paths of a model that depends on time have at most {MOST_NOISES}; take a smaller one"
            raise wrong(f"has {noises(self.model)} Wiener processes", right, "model")
        for name in self.schemes_used:
            self._check_scheme(name)
            self._check_facts(name)
        if self.noise:
            self.check_driven()
            self.noise.check(self)

    def _check_scheme(self, name: str) -> None:
        """The step of a scheme is one for the size, the friction and the flows of the model."""
        scheme = self.row(name)
        if large(self.model) and not scheme.for_large_models:
            right = "use euler_maruyama or a splitting without joint flows and Lévy areas"
            raise wrong_scheme(self, name, f"which is not for {self.model_name}", right)
        if has_friction(self.model) and scheme.multiscale:
            fault = f"has '{name}', whose noise is a fast process, for which no friction is known"
            raise wrong(fault, "leave out the scheme or temperature", "schemes")
        if judges(scheme.record) and flows_lacking(self.model):
            fault = f"has '{name}', which is made of exact flows, and not all are known of {self.model_name}"
            raise wrong(fault, "use another", "schemes")

    def _check_facts(self, name: str) -> None:
        """Fact that a scheme ``needs``, if any, holds for the model."""
        if not (needs := self.row(name).needs):
            return
        if needs is has_bath and not needs(self.model):
            raise wrong(f"has '{name}', which needs a temperature", "add temperature: T, or use another", "schemes")
        if needs is lie_poisson and not needs(undamped(self.model)):
            raise wrong_scheme(self, name, "which needs a bracket that is linear", "use another")
        if not needs(self.model):
            able = " and ".join(n for n, cls in MODELS.items() if needs(cls))
            able += " without damping" if self.damping else ""
            raise wrong_scheme(self, name, f"which is for {able}", "use another")

    @condition
    def _check_lists(self) -> None:
        for key in self.distinct:
            check_distinct(getattr(self, key, None) or (), key)

    @condition
    def _check_areas(self) -> None:
        """Gaussian areas have their law alone, and some scheme must need them."""
        if self.areas == "exact":
            return
        if self.along_paths:
            fault = f"is '{self.areas}', but strong errors are those of given paths, which have areas of their own"
            raise wrong(fault, "leave it out", "areas")
        if not any(needs_areas(self.row(name).record) for name in self.schemes_used):
            users = ", ".join(name for name, row in SCHEMES.items() if needs_areas(row.record))
            raise wrong(f"is '{self.areas}', but no scheme needs Lévy areas", f"leave it out, or use {users}", "areas")

    @condition
    def _check_eps(self) -> None:
        """There is an eps where a scheme needs one, and else none."""
        multiscale = [s for s in self.schemes if self.row(s).multiscale]
        if multiscale and self.eps is None:
            raise wrong("missing key 'eps'", f"'{multiscale[0]}' needs it: add eps: scale of the fast processes", "eps")
        if self.eps is not None:
            if not multiscale:
                users = ", ".join(name for name, row in SCHEMES.items() if row.multiscale)
                raise wrong("is used by none of the schemes", f"leave it out or use one of {users}", "eps")
            check_distinct([f"{eps:g}" for eps in self.eps], "eps")  # as results are named
            for name in multiscale:
                if self.row(name).needs_eps and 0 in self.eps:
                    raise wrong(f"has 0, which '{name}' cannot have", "must be positive for it", "eps")

    _check_sweep = condition(check_shown)

    @condition
    def _check_expect(self) -> None:
        _ = self.claims


class StepCase(BaseCase):
    """A case whose paths have one step size."""

    final_time: key_of(Positive, "final time T, a multiple of the step", "time")
    step: key_of(Positive, "step size h", "time")
    schemes: key_of(Schemes, "a list of schemes")
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @property
    def noise_steps(self) -> tuple[float, ...]:
        """Step."""
        return (self.step,)

    @condition
    def _check_step(self) -> None:
        check_step(self)


class ErrorCase(BaseCase):
    """Keys of errors against step sizes."""

    final_time: key_of(Positive, "final time T, a multiple of every step", "time")
    steps: key_of(Steps, "step sizes, a list or a range such as 2^-5 .. 2^-13", "time")
    reference_step: key_of(Positive, "step size of the reference; steps are 2, 4, 8, ... times as large", "time")
    schemes: key_of(Schemes, "a list of schemes")
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False
    reference_scheme: key_of(SchemeName | None, "scheme of the reference; default: each its own") = None

    listed_under: ClassVar[str] = "errors"
    bounded_increments: ClassVar[bool] = True  #: whether schemes that need them must have them

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @property
    def noise_steps(self) -> tuple[float, ...]:
        """Reference step."""
        return (self.reference_step,)

    @condition
    def _check_steps(self) -> Self:
        """Case with its steps from large to small."""
        check_count(self.final_time, self.reference_step, "reference_step")
        steps = [dyadic(self, h) for h in self.steps]
        if len(set(steps)) < len(steps):
            raise wrong(f"has {quantity(next(h for h in steps if steps.count(h) > 1))} twice", "remove one", "steps")
        check_schemes(self, self.schemes_used if self.bounded_increments else (), steps, "steps")
        return self.model_copy(update={"steps": tuple(sorted(steps, reverse=True))})

    @condition
    def _check_reference_scheme(self) -> None:
        name = self.reference_scheme
        if name and self.row(name).needs_eps and not all(eps for _, eps in self.runs):
            raise wrong(f"is '{name}', which needs eps > 0 for every scheme", "use another", "reference_scheme")


class FunctionsCase(FunctionKeys, ErrorCase):
    """Keys of errors of expectations of test functions."""


# ---------------------------------------------------------------------------------------------------------------------
# Damping and temperature
# ---------------------------------------------------------------------------------------------------------------------


def _damped(case: Any) -> Any:
    """Record of the model of a case, with its damping; raises the error about it if it cannot be."""
    if large(case.model):
        raise wrong(f"is for models of few components, which {case.model_name} is not", "leave it out", "damping")
    degrees = casimir_degrees(case.model)
    if len(degrees) != conserved(case.model):
        fault = f"is for models that state the degrees of their Casimir functions, which {case.model_name} does not"
        raise wrong(fault, "leave it out, or state casimir_degrees", "damping")
    if laws := case.laws_shown:
        raise wrong(f"has '{laws[0]}', and no law is known with damping", "leave out one of them", "panels")
    most = _MOST_DECAY / max(degrees, default=1) / case.last_time
    if case.damping > most:
        fault = f"is {quantity(case.damping)}, with which all states are 0 but for rounding before the end"
        raise wrong(fault, f"must be at most {most:.3g} for paths until the time {quantity(case.last_time)}", "damping")
    return damped(case.model, case.damping)


def _dissipative(case: Any) -> Any:
    """Record of the model of a case with its damping or at its temperature."""
    if math.isfinite(case.temperature):
        return _thermal(case)
    return _damped(case) if case.damping else case.model


def _thermal(case: Any) -> Any:
    """Record of the model of a case at its temperature; raises the error about it if it cannot be."""
    model, temperature = case.model, case.temperature
    if temperature == 0:
        right = "for selective decay at the rate gamma take a small one, T, and sigma = sqrt(2*gamma*T)"
        raise wrong("is 0, at which friction would be infinite", right, "temperature")
    if case.damping:
        raise wrong("is given beside damping, with which no law is stationary", "leave out one of them", "temperature")
    if case.noise:
        fault = "is given beside noise, and friction belongs to Brownian motion"
        raise wrong(fault, "leave out one of them", "temperature")
    if answers(bath_fault, model) and (lacks_bath := model.bath_fault()):
        raise wrong(*lacks_bath, "temperature")
    with_bath = model.at_temperature(temperature) if answers(at_temperature, model) else model
    if not (noises(with_bath) if large(with_bath) else noise_indices(with_bath)):
        fault = "is given to a model without noise, which nothing would bring to it"
        raise wrong(fault, "leave it out, or give sigma a number above 0", "temperature")
    if temperature < 0 and not has_compact_surfaces(model):
        fault = f"is {quantity(temperature)}, and no sum of Casimir functions of {case.model_name} bounds the state"
        raise wrong(fault, "must be above 0 where energy has no upper bound", "temperature")
    if laws := case.laws_shown:
        raise wrong(f"has '{laws[0]}', whose law is that without a temperature", "leave out one of them", "panels")
    return thermal(model, temperature)


def has_compact_surfaces(model: Any) -> bool:
    """Whether the quadratic Casimir functions that grow in every direction in which they change add up to all of |y|.

    Sufficient, not necessary: Casimir functions of other forms are not looked at.
    """
    if large(model) or squared_length_is_casimir(model):
        return True
    total = np.zeros((dimension(model), dimension(model)))
    for c in range(conserved(model)):
        with suppress(ValueError):  # it is not quadratic
            b, Q = casimir_form(model, c)
            total += 0 if b.any() else semidefinite(Q)
    return bool(np.linalg.eigvalsh(total)[0] > 1e-9)
