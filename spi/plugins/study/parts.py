"""The five experiments of a study, as spec files."""

import hashlib
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import drift_field, noise_field
from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import conserved, in_kernels, large, noise_indices, strengths
from spi.ensemble.random_states import RandomState
from spi.models.delegation import undamped
from spi.running import compiling
from spi.running.load import load
from spi.running.run import STARTING_SECONDS, cost, kernel_calls, plans
from spi.running.shipped import path_of
from spi.specs import Experiment, SpecError
from spi.specs.document import Document, text_of
from spi.specs.initial import names_in_formulas
from spi.specs.naming import as_yaml, completed, with_numbers

#: Keys of a system that all parts of a study have.
_SHARED = ("model", "damping", "temperature", "initial", "final_time", "seed", "compositions", "areas")

#: Schemes that a study compares where they can integrate the system.
_PATHWISE = ("splitting", "splitting_joint_areas", "munthe_kaas_midpoint", "midpoint", "euler_maruyama")
_IN_LAW = ("splitting", "splitting_order2", "euler_maruyama")

_SIZES, _FINER = 6, 3  # step sizes, each half of the former; halvings from the last one to the reference
_FEWEST_STEPS, _LARGEST_STEP = 16, 0.5  # of a step whose increments are truncated, at A_h = (4 |log h|)^(1/2)
_LARGEST_CHANGE = 0.25  # of the state relative to its length, in the largest step
_LONG = 2048  # steps of the path on which invariants are looked at
_FACTORS = [0.1, 0.3, 1, 3, 10]  # of the noises, where steps and noises become too large
_LARGER = 8  # steps that become too large: by this factor from the largest one for errors
_ERRORS = (0.1, 0.01)  # relative to the length of the initial value, for which the cheapest scheme is asked

#: Share of each part in the time of a study, and its fewest and most samples.
_SHARES = {"strong": 0.25, "weak": 0.3, "preserved": 0.0, "work": 0.3, "stability": 0.15}
_FEWEST, _MOST = 64, 10**5
_LEAST_SECONDS = 5.0  # of a study, whatever its kernels take to compile

#: What each part shows, its question, and its kind.
_PARTS = {
    "strong": ("strong errors", "Which strong orders do the schemes have?", "strong"),
    "weak": ("weak errors", "Which weak orders do the schemes have?", "weak"),
    "preserved": ("what is preserved", "What do the schemes preserve along one path?", "trajectory"),
    "work": ("work and error", "Which scheme reaches an error in the least time?", "work_precision"),
    "stability": ("large steps and noises", "How large may steps and noises be?", "stability"),
}


class Study(NamedTuple):
    """A system that is studied."""

    name: str  #: of its file, without the ending
    source: Experiment  #: of any kind, with its model, its initial value and its final time
    chosen: Mapping[str, Any]  #: the keys of a file that says no kind

    @property
    def title(self) -> str:
        """Title of the system."""
        return str(self.chosen.get("title", self.name.replace("_", " ")))

    @property
    def digest(self) -> str:
        """Digest of the file and of those that belong to it."""
        return hashlib.sha256(repr((self.source.text, self.source.files)).encode()).hexdigest()[:12]

    @property
    def words(self) -> tuple[str, ...]:
        """Words with which the names of the parts end."""
        return tuple(_PARTS)

    def path(self, word: str, folder: Path) -> Path:
        """Spec file of a part."""
        return folder / f"{self.name}_{word}.yaml"

    @classmethod
    def of(cls, path: Path) -> "Study":
        """Study of a file that says a model, an initial value and a final time, or of an experiment with these.

        SpecError if it cannot be integrated, or is of several systems.
        """
        file = path_of(path)
        text = text_of(file)
        data = Document(text, lambda line: f"{path}:{line}:").data
        whole = not isinstance(data, dict) or "kind" in data
        source = load(path) if whole else load(path, text=completed(text, _rest(data)))
        given = Document(source.text, str).data
        if several := [key for key in ("cases", "sweep", "eps") if given.get(key)]:
            right = "a study is of one system; write it into a file of its own, without this key"
            raise SpecError(f"{path}: {several[0]}: is given; {right}")
        if large(source.cases[0].model):
            right = "a study is of systems whose state is a few numbers"
            raise SpecError(f"{path}: model: {source.cases[0].model_name} has a state that is an array; {right}")
        return cls(file.stem, source, {} if whole else data)

    def specs(self, minutes: float) -> dict[str, str]:
        """Texts of the spec files, by the word with which their names end, for so many minutes in all."""
        given = Document(self.source.text, str).data
        case: Any = self.source.cases[0]
        shared = {key: given[key] for key in _SHARED if key in given} | {"final_time": case.last_time}
        steps = case.steps if "steps" in self.chosen else _steps(case)
        finest = case.reference_step if "steps" in self.chosen else steps[-1] * 2.0**-_FINER
        grid = {"steps": [*steps], "reference_step": finest}
        coarser = [h for h in (4 * steps[0], 2 * steps[0]) if h <= min(_LARGEST_STEP, case.last_time / 2)]
        pathwise, in_law = (
            self.chosen.get("schemes") or self._able(shared, grid, names) for names in (_PATHWISE, _IN_LAW)
        )
        paths = {"truncate_noise": True, "schemes": pathwise}
        keys: dict[str, dict[str, Any]] = {
            "strong": shared | grid | paths,
            "weak": shared | grid | {"steps": [*coarser, *steps[:4]], "schemes": in_law},
            "preserved": shared | paths | {"step": steps[0], "final_time": steps[0] * _LONG},
            "work": shared | grid | paths | {"steps": [*coarser, *steps], "targets": _targets(case)},
            "stability": shared | {"schemes": pathwise} | _stronger(shared, case),
        }
        if any(case.row(name).needs_truncation for name in in_law):
            keys["weak"]["truncate_noise"] = True
        keys["weak"] |= {"functions": given.get("functions") or _function(case), "estimators": ["multilevel"]}
        keys["preserved"]["panels"] = [*["casimir_errors"] * bool(conserved(case.model)), "hamiltonian"]
        large_steps = [steps[0] * 2.0**-k for k in range(1 - _LARGER.bit_length(), _SIZES)]
        keys["stability"] |= {"steps": large_steps, "reference_step": large_steps[-1] / 4, "panels": ["regimes"]}
        if "sweep" not in keys["stability"]:
            del keys["stability"]
        heads = {
            word: {"title": f"{self.title}: {what}", "asks": asks, "kind": kind}
            for word, (what, asks, kind) in _PARTS.items()
        }
        return self._sized({word: heads[word] | own for word, own in keys.items()}, 60 * minutes)

    def experiment(self, word: str, text: str, folder: Path) -> Experiment:
        """Part of the study with this text, as a file of the folder."""
        return load(self.path(word, folder), text=text, files=self.source.files)

    def _able(self, shared: dict[str, Any], grid: dict[str, Any], names: Iterable[str]) -> list[str]:
        """Those of the schemes that can integrate the system."""

        def can(name: str) -> bool:
            keys = shared | grid | {"kind": "strong", "samples": 2, "truncate_noise": True, "schemes": [name]}
            try:
                self.experiment("strong", as_yaml(keys), Path())
            except SpecError:
                return False
            return True

        return [name for name in names if can(name)]

    def _sized(self, keys: Mapping[str, Mapping[str, Any]], seconds: float) -> dict[str, str]:
        """Texts of the parts, with as many samples as take their shares of the time that compiling leaves."""
        few = {"trajectory": {}, "weak": {"seconds": 1}}
        sized = {word: {**own, **few.get(own["kind"], {"samples": _FEWEST})} for word, own in keys.items()}
        ready = {word: self.experiment(word, as_yaml(own), Path()) for word, own in sized.items()}
        jobs = compiling.missing([call for one in ready.values() for call in kernel_calls(plans(one))])
        to_compile = sum(job.seconds for job in jobs) / max(1, compiling.processes_for(jobs))
        left = max(seconds - to_compile - len(ready) * STARTING_SECONDS, _LEAST_SECONDS)
        for word, own in sized.items():
            if "samples" in own:
                least = max(cost(ready[word]).seconds - STARTING_SECONDS, 1e-3)
                own["samples"] = _nice(min(_FEWEST * max(left * _SHARES[word] / least, 1.0), _MOST))
            elif "seconds" in own:
                own["seconds"] = _nice(max(1.0, left * _SHARES[word] * thread_count() / len(own["schemes"])))
        return {word: as_yaml(with_numbers(own)) for word, own in sized.items()}


def _rest(data: Mapping[str, Any]) -> dict[str, Any]:
    """Keys that make an experiment of a file that only says a system."""
    time = data.get("final_time")
    steps = data.get("steps", [f"({time})/2^20" if isinstance(time, str) else 2.0**-20])
    last = steps[-1] if isinstance(steps, list) and steps else str(steps).rpartition("..")[2]
    whole = {
        "steps": steps,
        "reference_step": f"({last})/{2**_FINER}",
        "truncate_noise": True,
        "schemes": ["splitting"],
    }
    more = {"kind": "weak", "estimators": ["plain"]} if "functions" in data else {"kind": "strong"}
    return {key: value for key, value in (more | whole | {"samples": 2}).items() if key not in data}


def _state(case: Any) -> tuple[float, ...]:
    """Initial value; of a random one the mean of some states."""
    if isinstance(case.initial, RandomState):
        numbers = np.random.default_rng(1).standard_normal((case.initial.law.numbers, 64))
        return tuple(np.mean(case.initial.law.states(numbers), axis=1).tolist())
    return tuple(case.initial)


def _steps(case: Any) -> tuple[float, ...]:
    """Step sizes T/2^k for errors, the largest of which changes the state by a quarter of its length at most."""
    y, model, time = _state(case), in_kernels(case.model), case.last_time
    with uncompiled(), np.errstate(all="ignore"):
        speed = np.linalg.norm(drift_field(model, y))
        spread = [strengths(model)[k] * np.linalg.norm(noise_field(model, k, y)) for k in noise_indices(model)]
    length = np.linalg.norm(y) or 1.0
    rate = speed / length + np.sum(np.square(spread)) / length**2
    fewest = max(_FEWEST_STEPS, time / _LARGEST_STEP, time * rate / _LARGEST_CHANGE if np.isfinite(rate) else 0.0)
    first = math.ceil(math.log2(fewest))
    return tuple(time * 2.0**-k for k in range(first, first + _SIZES))


def _targets(case: Any) -> list[float]:
    length = float(np.linalg.norm(_state(case))) or 1.0
    return [float(f"{length * error:.1g}") for error in _ERRORS]


def _function(case: Any) -> str:
    """A smooth bounded function of all components."""
    scale = float(f"{max(map(abs, _state(case)), default=1.0) or 1.0:.1g}")
    over = "" if scale == 1 else f"/{scale:g}"
    return " + ".join(f"sin({name}{over})" for name in names_in_formulas(case.model))


def _stronger(shared: Mapping[str, Any], case: Any) -> dict[str, Any]:
    """The model with all its noises times a factor that is swept; nothing without noises."""
    sigma = strengths(undamped(case.model))
    if not any(sigma):
        return {}
    model = {**shared["model"], "sigma": [f"{float(value)!r}*noise_factor" for value in sigma]}
    return {"model": model, "sweep": {"noise_factor": _FACTORS}}


def _nice(number: float) -> int:
    """The largest whole number with one digit that is not above."""
    digits = 10 ** int(math.log10(number))
    return int(number // digits * digits)
