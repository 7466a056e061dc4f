"""Questions drawn at random, E phi(y(T)) to a wanted accuracy, and how often the stated intervals hold the truth.

    python benchmarks/questions.py --count 40 --accuracies 1e-3 1e-4 [--first 0] [--out questions.json] [--plot FILE]

Four built-in systems and four from YAML, their parameters, initial values, functions and final times drawn from the
ranges below.  The truth is the solution without sampling where there is one, and the questions are sampled all the
same; else an answer by another scheme, from other paths, to an accuracy that is --finer.  A line for each question has
the distance from the truth in half widths (of both together), the processor time over the one that was predicted, and,
without that of the pilot, over that of the best fixed choice: plain Monte Carlo or multilevel differences with any
step, largest step and extrapolation, by the variances, biases and times that were measured.  Results are added to the
JSON file, so that many runs make one table.

Supports: docs/answer.md and docs/appendix/answer.md, "How reliable it is".

Short form: --count 1 --accuracies 1e-2
"""

import argparse
import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np

from spi.kinds.plans import State
from spi.plugins.answers.kinds.answer import study
from spi.plugins.answers.kinds.answer.allocation import QUASI_PILOT_SAMPLES
from spi.plugins.answers.kinds.answer.decisions import pilot_of
from spi.plugins.answers.kinds.answer.planner import bound, choose
from spi.plugins.answers.kinds.answer.sets import LEVELS, Role
from spi.running import workers
from spi.running.compiling import compile_missing
from spi.running.run import kernel_calls, load
from spi.statistics.estimators import weights
from spi.storage.records import INTERVAL

SYSTEMS = Path(__file__).parents[1] / "experiments" / "systems"

#: name -> (keys of the model but sigma, numbers of noises, range of their strengths, functions, range of components)
QUESTIONS: dict[str, Any] = {
    "rigid_body": ({"name": "rigid_body"}, 3, (0.2, 1.0), 3, (-1.0, 1.0)),
    "maxwell_bloch": ({"name": "maxwell_bloch"}, 2, (0.2, 0.8), 3, (-1.0, 1.0)),
    "lotka_volterra": ({"name": "lotka_volterra"}, 1, (0.1, 0.6), 2, (0.5, 2.0)),
    "sine_euler": ({"name": "sine_euler"}, 4, (0.1, 0.5), 8, (-0.7, 0.7)),
    "heavy_top": ({"system": "heavy_top.yaml"}, 2, (0.1, 0.7), 6, (-1.0, 1.0)),
    "toda": ({"system": "toda.yaml"}, 2, (0.1, 0.4), 9, (0.2, 0.8)),
    "manakov": ({"system": "manakov.yaml"}, 2, (0.1, 0.5), 6, (-1.0, 1.0)),
    "spin_ring": ({"system": "spin_ring.yaml"}, 4, (0.1, 0.7), 12, (-0.8, 0.8)),
}
SOLVED = ("rigid_body", "maxwell_bloch")
FUNCTIONS = ("{0}^2", "sin(2*{0}) + {1}", "{0}*{1}", "cos({0} + {1})", "exp(-{0}^2)", "tanh({0} - {1})")


def question(number: int, accuracies: list[float], seconds: float) -> tuple[str, dict[str, Any]]:
    """The system and the keys of question number `number`."""
    draw = random.Random(f"question {number}")
    name = list(QUESTIONS)[number % len(QUESTIONS)]
    model, noises, strengths, d, components = QUESTIONS[name]
    sigma = [round(draw.uniform(*strengths), 3) for _ in range(noises)]
    if draw.random() < 0.3:  # one noise alone, always the same, so that there is one more kernel
        sigma = [sigma[0]] + [0.0] * (noises - 1)
    model = {**model, "sigma": sigma}
    if name == "rigid_body":
        model["inertia"] = [round(draw.uniform(0.6, 2.5), 3) for _ in range(3)]
        model["noise_inertia"] = [round(draw.uniform(0.8, 3.0), 3) for _ in range(3)]
    chosen = [f"y{k + 1}" for k in draw.sample(range(d), 2)]
    return name, {
        "kind": "answer",
        "model": model,
        "initial": [round(draw.uniform(*components), 3) for _ in range(d)],
        "final_time": draw.choice([0.5, 1, 1.5, 2, 3, 5]),
        "functions": draw.choice(FUNCTIONS).format(*chosen),
        "accuracy": accuracies[(number // len(QUESTIONS)) % len(accuracies)],
        "seed": number + 1,
        "sampling": True,
        "seconds": seconds,
    }


def answered(keys: dict[str, Any]) -> tuple[Any, State]:
    """The plan and the final state of a question."""
    text = "\n".join(f"{key}: {json.dumps(value)}" for key, value in keys.items())
    (case,) = load(SYSTEMS / "question.yaml", text=text).cases
    plan = study.plan(case, study.parts(case)[0])
    state = State(plan)
    compile_missing(kernel_calls([plan]))
    workers.advance_here([state], lambda number: None)
    return plan, state


def truth_of(name: str, keys: dict[str, Any], finer: float) -> tuple[float, float]:
    """The expectation, and half the width of its own interval."""
    if name in SOLVED:
        other = {**keys, "sampling": False, "accuracy": keys["accuracy"] / 20, "seconds": 3600}
        plan, state = answered(other)
        found = plan.results(state)
        if found.chosen is None:
            return float(found.value[0]), float(found.half[0])
    exact = {
        "schemes": ["splitting_symmetric"],
        "seed": keys["seed"] + 10**6,
        "accuracy": keys["accuracy"] / finer,
        "seconds": 1e6,
    }
    plan, state = answered({**keys, **exact})
    found = plan.results(state)
    return float(found.value[0]), float(found.half[0])


def counted(plan: Any, state: State) -> tuple[float, float]:
    """Seconds of typical speed of all paths, and of those of the pilots, which no load of the machine moves."""
    paths = np.reshape([state.tally(i).paths for i in range(len(plan.sets))], plan.costs.shape)
    pilots = [np.minimum(pilot_of(s, len(paths)), paths) for s in range(state.extra.schemes_piloted)]
    piloted = np.sum(pilots, axis=0)
    piloted[:, Role.POINTS :] += np.minimum(paths[:, Role.POINTS :], QUASI_PILOT_SAMPLES)
    return plan.seconds_of(paths), plan.seconds_of(piloted)


def best_fixed(plan: Any, state: State, accuracy: float) -> float:
    """Seconds of typical speed of the best fixed choice, of the scheme that was chosen, by what was measured."""
    scheme = state.extra.scheme
    known = plan.measured(state, scheme)
    exponents = plan.exponents(scheme)
    levels = [n for n in plan.case.extrapolate if not n or len(exponents) > n]
    one = choose(known, exponents, levels, accuracy)
    works = [one.work]
    for n in levels:  # plain: all steps on common paths, whose variance is that of phi at most
        w = weights(exponents[:n])
        finest = next((k for k in range(n + 1, LEVELS - 1) if _bias(known, exponents, n, k) <= 0.5 * accuracy), None)
        if finest is not None:
            variance = known.value_variance[min(finest, known.last)].max()
            cost = sum(plan.costs[scheme, Role.VALUES, finest - i] for i in range(len(w)))
            works.append(variance * cost * (INTERVAL / (accuracy - _bias(known, exponents, n, finest))) ** 2)
    return float(min(works))


def _bias(known: Any, exponents: Any, levels: int, finest: int) -> float:
    return float(bound(known, exponents, levels, finest).max())


def asked(number: int, accuracies: list[float], finer: float, seconds: float) -> dict[str, Any]:
    """One question, answered and compared."""
    name, keys = question(number, accuracies, seconds)
    plan, state = answered(keys)
    found = plan.results(state)
    truth, doubt = truth_of(name, {**keys, "accuracy": float(found.aim)}, finer)
    (total, pilot), fixed = counted(plan, state), best_fixed(plan, state, float(state.extra.aim))
    off = abs(float(found.value[0]) - truth)
    return {
        "number": number,
        "system": name,
        "accuracy": keys["accuracy"],
        "commuting": sum(s > 0 for s in keys["model"]["sigma"]) < 2,
        "T": keys["final_time"],
        "function": keys["functions"],
        "off": off / math.hypot(float(found.half[0]), doubt),
        "doubt": doubt / float(found.half[0]),
        "error": off,
        "half": float(found.half[0]),
        "bias": float(found.bias[0] / found.half[0]),
        "scheme": found.chosen.scheme,
        "levels": found.chosen.extrapolated,
        "smallest": found.chosen.smallest_step,
        "seconds": found.cpu_seconds,
        "pilot": found.pilot_seconds,
        "time": found.cpu_seconds / found.predicted_seconds,
        "work": total,
        "best": total / fixed,
        "rest": (total - pilot) / fixed,
        "points": found.chosen.points,
        "aim": found.aim,
        "reached": found.reached,
        "warnings": list(found.warnings),
    }


def show(found: list[dict[str, Any]]) -> None:
    """The summary of all questions."""
    off = np.array([one["off"] for one in found])
    time, best, rest = (np.array([one[key] for one in found]) for key in ("time", "best", "rest"))
    large = np.array([one["work"] > 0.1 for one in found])
    print(f"{len(found)} questions: {np.mean(off <= 1):.1%} within the interval, at most {off.max():.2f} half widths")
    print(f"mean square of the distance in half widths {np.mean(off**2):.3f} (0.26 for 95 %)")
    for what, chosen in (("all", large | True), ("those above 0.1 s", large)):
        if chosen.any():
            within = np.mean(np.abs(np.log2(time[chosen])) <= 1)
            print(f"{what}: time within a factor of 2 of the prediction {within:.0%}, ", end="")
            print(f"work at most 1.5 times that of the best fixed choice {np.mean(best[chosen] <= 1.5):.0%}, ", end="")
            print(f"without the pilot {np.mean(rest[chosen] <= 1.5):.0%}")


def plot(found: list[dict[str, Any]], file: str) -> None:
    """Achieved against predicted accuracy."""
    from spi.drawing import Figure, as_bytes, page

    with page.applied():
        fig = Figure((6.4, 4.2), layout="constrained")
        _plot(fig.subplots(), found)
        Path(file).write_bytes(as_bytes(fig, "png", dpi=150))


def _plot(ax: Any, found: list[dict[str, Any]]) -> None:
    for name in QUESTIONS:
        own = [one for one in found if one["system"] == name]
        half, error = [one["half"] for one in own], [max(one["error"], 1e-9) for one in own]
        ax.plot(half, error, "o", label=name.replace("_", " "), alpha=0.7)
    ends = np.array(ax.get_xlim())
    ax.plot(ends, ends, color="black", label="half the width")
    ax.set(xscale="log", xlabel="predicted: half width of the interval")
    ax.set(yscale="log", ylabel="achieved: distance from the truth")
    ax.grid(True, color="#e6e6e6", linewidth=0.6)
    ax.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--accuracies", type=float, nargs="+", default=[1e-3, 1e-4])
    parser.add_argument("--finer", type=float, default=4.0, help="of a truth that is sampled")
    parser.add_argument("--seconds", type=float, default=3600.0, help="of typical speed, for each answer")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot")
    given = parser.parse_args()
    found = json.loads(given.out.read_text()) if given.out and given.out.exists() else []
    done = {(one["number"], one["accuracy"]) for one in found}
    for number in range(given.first, given.first + given.count):
        if (number, question(number, given.accuracies, given.seconds)[1]["accuracy"]) in done:
            continue
        one = asked(number, given.accuracies, given.finer, given.seconds)
        found.append(one)
        told = {key: f"{value:.3g}" if isinstance(value, float) else value for key, value in one.items()}
        print(" ".join(f"{key}={told[key]}" for key in told if key not in ("error",)), flush=True)
        if given.out:
            given.out.write_text(json.dumps(found, indent=1))
    show(found)
    if given.plot:
        plot(found, given.plot)


if __name__ == "__main__":
    main()
