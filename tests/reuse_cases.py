"""Specs that are changed a little, and run onto the folder of the unchanged one: the means of test_reuse.py.

The keys are those of the schema, values of a
key are those of the specs here and what can be made of them, and of the schema: a new key needs no line here, unless
nothing else makes a value that it can have.
"""

import functools
import io
import shutil
import tempfile
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from own_models import OSCILLATOR

from spi import storage
from spi.kinds import KINDS
from spi.running import run as runner
from spi.running.checkpoint import sums_keys
from spi.running.load import plans
from spi.specs import SpecError
from spi.specs.experiment import ONLY_IN_FILES
from spi.specs.files import array_text, as_text
from spi.specs.models import SOURCES
from spi.specs.noise import NOISES

BODY = "model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"
SCHEMES = "schemes: [splitting, splitting_order2]"
START = "initial: [cos(1.1), 0, sin(1.1)]\nseed: 3\ntitle: A title\nasks: What?\nfigure: 2"
ERRORS = f"{BODY}\n{START}\nfinal_time: 1\nsteps: [1/4, 1/8]\nreference_step: 1/16\n{SCHEMES}"
FUNCTIONS = "functions: {b: y1^2, c: y3, a: sin(y2)}"

#: By kind what is changed.
SPECS = {
    "strong": f"{ERRORS}\nsamples: 130",
    "weak": f"{ERRORS}\n{FUNCTIONS}\nsamples: 512\nprefixes: [64, 128]\npanels: [errors, samples]\n"
    "estimators: [plain]\nextrapolate: [0, 1]",
    "work_precision": f"{ERRORS}\nfunctions: {{b: y1^2}}\nsamples: 128\nestimators: [plain]\n"
    "targets: [0.1, 0.01]\nrepeats: 3",
    "stability": f"{ERRORS.replace('[1, 1, 1]', '[s, s, s]')}\n{FUNCTIONS}\nsamples: 70\nsweep: {{s: [1, 1/2]}}\n"
    "accurate: 0.2\npanels: [regimes, error]",
    "trajectory": f"{BODY}\n{START}\nfinal_time: 1\nstep: 1/16\n{SCHEMES}\nevery: 2\npath: 3\n"
    "panels: [casimirs, components, hamiltonian]\ntimes: [0, 1/2]",
    "growth": f"{BODY}\n{START}\nsteps: [1/4, 1/8]\nstep_count: 512\n{SCHEMES}\nsamples: 70\npanels: [growth, law]",
    "equilibrium": f"{BODY}\n{START}\nsteps: [1/4, 1/8]\nfinal_time: 64\n{SCHEMES}\nsamples: 70\n"
    f"{FUNCTIONS}\nburn_in: 8\nspacing: 1/2\nbins: 8\nreference: {{a: 0, b: finest, c: 0.1}}\naccuracy: 0.1\n"
    "panels: [means, histogram]",
    "statistics": f"{BODY}\n{START}\nfinal_time: 1\nstep: 1/8\n{SCHEMES}\nsamples: 100\n"
    "functions: {b: y1^2, c: y3, a: sin(y2), m: {maximum: y1}}\nevery: 2\nquantiles: [0.1, 0.5]\nbins: 8\n"
    "statistics: [mean, variance, covariance, quantiles, histogram]\ndensity: {of: [b, c], times: [1/2, 1], cells: 4}\n"
    "autocorrelation: {c: 1/2, b: 1/4}\nreference: {b: 1/3 + exp(-t), c: {file: known.csv}}\n"
    "panels: [mean, histogram]",
    "lyapunov": f"{BODY}\n{START}\nfinal_time: 4\nstep: 1/16\n{SCHEMES}\nsamples: 70\nwarm_up: 1\n"
    "every: 4\npullback: {points: 128, times: [1, 2]}\npanels: [lyapunov, pullback]",
    "answer": f"{BODY}\n{START}\nfinal_time: 1\n{FUNCTIONS}\naccuracy: 3e-2\nschemes: [splitting_order2, splitting]\n"
    "samples: 4096\nsampling: true",
}
#: What is laid over those of every kind that can have it: keys that are changed and, after `---`, others beside them.
#: Where kernels of its own are compiled, one scheme is enough, and a composition is one of the flows of the others.
LAYERS = (
    "cases: [{name: one}, {name: two, seed: 4, title: Two}]",
    "cases: [{name: one, schemes: [splitting]}, {name: two, schemes: [splitting], final_time: 2}]",
    "profiles: {quick: {seed: 5}}",
    "sweep: {s: [1, 1/2]}\nmodel: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [s, s, s]}",
    "initial: {law: points, file: points.csv}",
    "initial: {law: points, file: points.npz}",
    "initial: {law: gaussian, mean: [0, 0, 1], sd: 0.1, project: true}",
    "initial: {file: y.npy}",
    "damping: 0.25\n---\nschemes: [splitting]",
    "temperature: 2\n---\nschemes: [splitting]",
    "truncate_noise: true",
    "areas: gaussian\n---\nschemes: [splitting_areas]",
    "times: [0, 1/2, 1]\nevery: 1\nautocorrelation: {c: 1/2}",
    "eps: [1, 1/2]\n---\nschemes: [ap_splitting, splitting]\nextrapolate: 0",
    f"eps: s\nsweep: {{s: [1, 1/2]}}\n---\nschemes: [ap_splitting]\n{BODY}",
    "compositions: {mine: [noise 1, drift 1], other: [drift 1, noise 1]}\n---\nschemes: [mine, other]",
    "compositions: {heun: {python: heun.py, name: Heun, strong_order: 1/2, weak_order: 1}}\n---\n"
    "schemes: [heun, splitting]",
    "model: {python: oscillator.py, name: Oscillator}\ninitial: [1, 0]\n---\nschemes: [splitting]\n"
    "functions: {b: y1}\nreference:\ndensity:",
    "reference_scheme: splitting\n---\nschemes: [splitting]\nextrapolate: 0",
    "accuracy: 1e-4\nestimators: [kolmogorov]\nextrapolate: [0, 1]\nsteps: [1/2, 1/4, 1/8]\n---\n"
    "schemes: [splitting_order2]\npanels: [errors]\nfunctions: {b: y1^2}",
    "seconds: 0.002\n---\nestimators: [multilevel]\npanels: [errors]\nfunctions: {b: y1^2}",
    "standard_error: 0.1\nseconds: 1\n---\nestimators: [multilevel]\npanels: [errors]\nfunctions: {b: y1^2}",
    "estimators: [quasi, multilevel]\n---\nschemes: [splitting]\n"
    "samples: 512\nseconds: 0.002\npanels: [errors]\nfunctions: {b: y1^2}",
    "functions:\nestimators:\nextrapolate:",
    "step_count: 256",
    "density: sphere",
    "step: 1/4\nautocorrelation: {c: 1/2}",
    "reference: {b: stationary, a: exact}",
    "reference: {a: {file: known.csv}}",
    "exponents: 1",
    "save: [1/2, 1]\nsection: {of: y2, store: [y1, y3]}\n---\nevery: 1\ntimes:",
    "python: angle.py",
    "python: angle.py\n---\nfunctions: {b: angle}\nreference:\ndensity:\nautocorrelation:",
    *(f"expect: {{splitting: {{{one}}}}}" for one in ("nonfinite: 1", "finite: 1", "deviation: 4", "dimension: 2")),
    "expect: {splitting_order2: {value: 1}}",
    "pullback: {points: 64}",
    "steps: [1/2, 1/4, 1/8, 1/16, 1/32]\nextrapolate: [0, 1]",
)
if "system" in SOURCES:
    LAYERS += (
        "model: {system: top.yaml, parameters: {c: 2}}\n---\n"
        "schemes: [splitting]\nfunctions: {b: x}\nreference:\ndensity:",
    )
if "file" in NOISES:
    LAYERS += (
        "noise: {kind: ornstein_uhlenbeck, tau: 0.1}\n---\nschemes: [splitting]\nextrapolate: 0",
        "noise: {file: dW.npz}\n---\nextrapolate: 0",
    )


def archive(**arrays):
    """The text that stands for a file of numpy.savez."""
    data = io.BytesIO()
    np.savez(data, **arrays)
    return as_text(data.getvalue())


_DRAWN = np.random.default_rng(1).standard_normal((512, 32, 3)).astype(np.float32) / 4
_POINTS = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.8, 0.6, 0.0]])
_HEUN = (Path(__file__).parents[1] / "experiments" / "schemes" / "heun.py").read_text(encoding="utf-8")
_TOP = "algebra: so(3)\nvariables: [x, y, z]\nparameters: {a: 2, c: 1}\nhamiltonian: x^2/a + c*z^2\nnoises: [x, y]\n"

#: By name the texts of files, the first that of the unchanged spec: what a key refers to.
FILES = {
    "known.csv": ("t,value\n0,1\n0.25,1\n1,0.5\n", "t,value\n0,1\n0.25,1\n1,0.25\n", "t,value\n0.25,1\n1,0.5\n"),
    "dW.npz": tuple(
        archive(dW=dW, step=1 / 16) for dW in (_DRAWN, 2 * _DRAWN, _DRAWN[::-1], _DRAWN.reshape(1024, 16, 3))
    ),
    "points.csv": tuple(
        "\n".join(",".join(map(repr, one.tolist())) for one in points) for points in (_POINTS, _POINTS[::-1])
    ),
    "points.npz": tuple(
        archive(y=y, weight=np.array(weight, float))
        for y, weight in ((_POINTS, [1, 2, 3]), (_POINTS[::-1], [1, 2, 3]), (_POINTS, [3, 2, 1]), (-_POINTS, [1, 2, 3]))
    ),
    "y.npy": tuple(map(array_text, (_POINTS[0], _POINTS[1]))),
    "heun.py": (
        _HEUN,
        _HEUN.replace("return add_scaled(add_scaled(y, 0.5, first), 0.5, second)", "return add_scaled(y, 1.0, second)"),
    ),
    "angle.py": tuple(
        f"import numpy as np\n\n\ndef angle(y):\n    return {n} * np.arctan2(y[1], y[0])\n" for n in (1, 2)
    ),
    "oscillator.py": (OSCILLATOR, OSCILLATOR.replace("0.5 * (y[0] * y[0]", "0.25 * (2.0 * y[0] * y[0]")),
    "top.yaml": (
        _TOP,
        _TOP.replace("x^2/a", "x^2/(2*a)"),
        _TOP.replace("[x, y]", "[y, x]"),
        _TOP.replace("{a: 2, c: 1}", "{c: 1, a: 2}"),
    ),
}


class Spec(NamedTuple):
    """A spec, and the texts of the files that it names."""

    data: dict
    files: tuple = ()

    @classmethod
    def of(cls, data, **other):
        """With the first text of each file, or with the one of the number that is given."""
        named = {name: text for name, text in FILES.items() if name in str(data)}
        return cls(data, tuple((name, text[other.get(name, 0)]) for name, text in named.items()))

    @property
    def text(self):
        text = yaml.safe_dump(self.data, sort_keys=False)
        return text.replace("'true'", "true").replace("'false'", "false")

    @property
    def told(self):
        """As mappings are equal in another order."""
        return self.text, self.files

    def loaded(self):
        return runner.load("s.yaml", text=self.text, files=self.files)


class Change(NamedTuple):
    """One change of a key, or of what a file has to which a key refers."""

    key: str
    before: Spec
    after: Spec

    @property
    def told(self):
        """For a person."""
        return f"{self.key}:\n{self.before.text}to\n{self.after.text}"


def read(text):
    """A mapping in YAML, its numbers as texts."""
    return yaml.load(text, yaml.BaseLoader) or {}


@functools.cache
def keys_of(kind):
    """The keys of a kind by name, with their JSON Schema: those of its cases, and those of files."""
    schema = KINDS[kind].keys.Case.model_json_schema()["properties"]
    return {key: schema.get(key, {}) for key in [*schema, *ONLY_IN_FILES] if key not in ("name", "kind")}


def words_of(schema):
    """All words that a value with this JSON Schema may have."""
    if isinstance(schema, list):
        return [word for one in schema for word in words_of(one)]
    if not isinstance(schema, dict):
        return []
    own = [*schema.get("enum", ()), *([schema["const"]] if "const" in schema else [])]
    own += ["true", "false"] if schema.get("type") == "boolean" else []
    inner = [word for key, one in schema.items() if key not in ("default", "enum") for word in words_of(one)]
    return list(dict.fromkeys([*map(str, own), *inner]))


def others(value, words, deep=True):
    """Other values than one, and the same in another order; of what stands deeper in it the first entries alone."""
    if isinstance(value, dict):
        names = list(value)
        if len(names) > 1:
            yield dict(reversed(value.items()))
            yield dict(zip(names, [*value.values()][::-1], strict=True))
            yield {name: value[name] for name in names[1:]}
        if names:
            yield {f"{name}2" if name == names[0] else name: one for name, one in value.items()}
        for name, one in value.items():
            yield from (value | {name: other} for other in others(one, words, False))
    elif isinstance(value, list):
        if len(value) > 1:
            yield from (value[::-1], value[1:], value[:-1])
        if value:
            yield from ([other, *value[1:]] for other in others(value[0], words, False))
        yield from ([*value, word] for word in words[:1] if deep)
    elif value in words:
        yield words[(words.index(value) + 1) % len(words)]
    else:
        yield f"2*({value})"
        if deep:
            yield f"({value})/2"


def from_nothing(schema):
    """What a key may be of which the spec has no value."""
    words = words_of(schema)[:3]
    yield from (*words, *([word] for word in words))
    yield from ("1", "2", "1/2", "y1", ["1", "1/2"], {"b": "1/2"})


def laid(kind, layer=""):
    """The spec of a kind with other keys, those that the kind has; one without a value is left out."""
    more = {key: one for text in layer.split("\n---\n") for key, one in read(text).items()}
    data = {"kind": kind, **read(SPECS[kind]), **{key: one for key, one in more.items() if key in keys_of(kind)}}
    if data.get("sweep") and "panels" not in more and kind not in {"trajectory", "stability"}:
        data.pop("panels", None)  # of a sweep they are its quantities
    return {key: value for key, value in data.items() if value != ""}


def changes(kind):
    """All changes of all keys of a kind, each once, those of one spec together."""
    keys, seen = keys_of(kind), set()
    for layer in ("", *LAYERS):
        data = laid(kind, layer)
        own = [key for key in read(layer.partition("\n---\n")[0]) if key in keys]
        before, found = Spec.of(data), []
        for key in own or ([] if layer else keys):
            values = others(data[key], words_of(keys[key])) if key in data else from_nothing(keys[key])
            found += [(key, Spec.of(data | {key: value})) for value in values]
            found.append((key, Spec.of({name: value for name, value in data.items() if name != key})))
        for name in [name for name, _ in before.files if not layer or name.partition(".")[0] in layer]:
            found += [(name, Spec.of(data, **{name: number})) for number in range(1, len(FILES[name]))]
        for key, after in found:
            if before.told != after.told and (before.told, after.told) not in seen:
                seen.add((before.told, after.told))
                yield Change(key, before, after)


#: What the names of times have in them, and of what else differs from run to run.
TIMED = ("seconds", "ns_per_step", "cost_rate", "threads")


def contents(group):
    """All that a group holds of what no clock decides, by name."""
    arrays = {name: ((name,), values) for name, values in group.coordinates.items()} | group.variables
    told = {name: repr(value) for name, value in group.attributes.items()}
    told |= {name: (axes, v.dtype, v.shape, v.tobytes()) for name, (axes, v) in arrays.items()}
    return {name: one for name, one in told.items() if not any(time in name for time in TIMED)}


def everything(path):
    """The same of all groups of a results file."""
    return {(group.name, name): one for group in storage.read(path).groups for name, one in contents(group).items()}


def digests(experiment, answers=True):
    """The digests of what decides the sums of all parts, and what they know besides."""
    keys = [entry for plan in plans(experiment) for entry in sums_keys(plan).items()]
    return {key for number, key in keys if answers or number is not None}


#: What may come of a change: the spec is invalid; nothing is reused and all computed anew; or numbers follow of which
#: some were there, equal to those of a fresh run, or not.
INVALID, ANEW, EQUAL, DIFFERENT = "invalid", "anew", "equal", "DIFFERENT"


def run(experiment, folder, **options):
    """The results file of an experiment; where times are measured, which nothing compares, of one block each."""
    with pytest.MonkeyPatch.context() as patch:
        if experiment.kind == "work_precision":
            patch.setattr("spi.plugins.comparisons.kinds.work_precision.study._PATH_STEPS", 1)
        return runner.run(experiment, folder, **options)


def run_onto(before, after, folder):
    """What comes of running one experiment onto the results of another, and how it differs from a fresh run."""
    path = runner.results_path(after, folder)
    with tempfile.TemporaryDirectory() as copy, tempfile.TemporaryDirectory() as new:
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        written = run(after, copy)
        found, right = everything(written), everything(run(after, new))
        if before.hash != after.hash:
            assert path.exists() and storage.former(written).read_bytes() == path.read_bytes()
    wrong = sorted(key for key in found.keys() | right.keys() if found.get(key) != right.get(key))
    return DIFFERENT if wrong else EQUAL if digests(before) & digests(after) else ANEW, wrong


def outcomes(some):
    """(change, what came of it, more about it) of some changes."""
    for _, of_one in groupby(some, key=lambda change: change.before.told):
        with tempfile.TemporaryDirectory() as folder:
            before = begun = None
            for change in of_one:
                try:
                    before = before or change.before.loaded()
                    after = change.after.loaded()
                except SpecError as error:
                    yield change, INVALID, error.messages
                    if before is None:
                        break
                    continue
                begun = begun or run(before, folder)
                yield change, *run_onto(before, after, folder)
