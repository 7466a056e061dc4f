"""Work before a run grows at most linearly with sites, noises, components, times and cases: each is doubled twice, and
what Python does to read a spec, to tell its cost and its kernels, and to go on with sums is counted."""

import sys

import pytest

from spi.kinds.plans import State
from spi.running import run as runner
from spi.running.checkpoint import sums_keys
from spi.running.load import load, plans

ERRORS = "steps: [1/4, 1/8]\nreference_step: 1/16\nsamples: 64"
#: By kind its keys, beside times.  A spectrum of exponents is for models with components.
KINDS = {
    "strong": ERRORS,
    "weak": f"{ERRORS}\nestimators: [plain]\nfunctions: {{f: H}}",
    "work_precision": f"{ERRORS}\nestimators: [plain]\ntargets: [0.1]\nfunctions: {{f: H}}",
    "trajectory": "step: 1/8\npanels: [functions]\nfunctions: {f: H}",
    "equilibrium": "steps: [1/8]\nsamples: 64\nfunctions: {f: H}",
    "statistics": "step: 1/8\nsamples: 64\nevery: 1\nfunctions: {f: H}",
    "lyapunov": "step: 1/8\nsamples: 64\nwarm_up: 1",
    "answer": "accuracy: 1e-1\nsampling: true\nfunctions: {f: H}",
}
RING = "{{name: spins, lattice: ring, size: [{}], bonds: {{exchange: 1}}, {}}}\ninitial: {{spins: [0, 0, 1]}}"
FLUID = "{{name: zeitlin, n: {}, noise: {{modes: [{}], sigma: 0.1}}}}\ninitial: {}"
BODY = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}\ninitial: [0.6, 0, 0.8]"


def ring(sites, own):
    return RING.format(sites, own)


def fluid(n, modes):
    along = [f"[{m1}, {m2}]" for m1 in range(1, n // 2 + 1) for m2 in range(-(n // 2), n // 2 + 1)]
    return FLUID.format(n, ", ".join(along[:modes]), [0.1] * (n * n - 1))


def cases_of(count):
    return f"\ncases: [{', '.join(f'{{name: c{k}, seed: {k}}}' for k in range(count))}]"


#: What grows: three sizes, and the model and other keys of each.
GROWING = {
    "sites at a temperature": ((16, 32, 64), lambda n: f"{ring(n, 'alpha: 0.5')}\ntemperature: 1"),
    "sites by colours": ((16, 32, 64), lambda n: f"{ring(n, 'alpha: 0.5, by: sites')}\ntemperature: 1"),
    "sites without noise": ((16, 32, 64), lambda n: ring(n, "alpha: 0")),
    "noises of a fluid": ((4, 8, 16), lambda n: fluid(7, n)),
    "components of a fluid": ((48, 80, 120), lambda d: fluid(int((d + 1) ** 0.5), 4)),
    "times": ((64, 128, 256), lambda n: BODY),
    "cases": ((2, 4, 8), lambda n: BODY + cases_of(n)),
}


def prepared(path):
    """What a run does before anything moves, and whenever it says how far it is."""
    experiment = load(path)
    ready = plans(experiment)
    runner.cost(experiment, ready)
    for plan in ready:
        sums_keys(plan)
        plan.kernel_calls()
        plan.progress(State(plan))


def work_of(path):
    """The work of :func:`prepared`, once caches are warm: calls, lines, each round of a loop for itself, and lengths.

    These are of what functions return, which may be made by one call, such as tuple(range(n)).
    """
    prepared(path)
    work = 0

    def more(_, event, value):
        nonlocal work
        work += 1 + (len(value) if event == "return" and isinstance(value, tuple | list | dict | set) else 0)
        return more

    before = sys.gettrace()
    sys.settrace(more)
    try:
        prepared(path)
    finally:
        sys.settrace(before)
    return work


COMPONENTS_ONLY = {"lyapunov"}
PRODUCT = [
    (kind, what) for what in GROWING for kind in KINDS if what in ("times", "cases") or kind not in COMPONENTS_ONLY
]


@pytest.mark.share(18)
@pytest.mark.parametrize("kind, what", PRODUCT)
def test_work_before_a_run_grows_at_most_linearly(kind, what, tmp_path):
    """One more of what grows is no more work between the larger two sizes than between the smaller two."""
    sizes, model = GROWING[what]
    work = []
    for n in sizes:
        time = n if what == "times" else 64
        keys = f"final_time: {time}\nschemes: [splitting_symmetric]\n{KINDS[kind]}"
        path = tmp_path / "s.yaml"
        path.write_text(f"kind: {kind}\n{keys}\nmodel: {model(n)}\n", encoding="utf-8")
        work.append(work_of(path))
    first, second = ((work[i + 1] - work[i]) / (sizes[i + 1] - sizes[i]) for i in (0, 1))
    assert second <= 1.25 * max(first, 1e-4 * work[0]), work
