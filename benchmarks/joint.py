"""What joint flows cost in `spi run`: a flow of a noise and a joint flow, and whole steps, random numbers included.

    python benchmarks/joint.py [model ...]

Times are `ns_per_step` of runs of the kind `statistics` that look at a path once, on one thread, the least of several
that are made in turn.  What a flow of some kind costs is what a step takes longer that makes all of them twice, half of
the step each time, with the same increments.  Beside them stands what `spi check` says of the run, and what it takes.

Supports: docs/joint.md, "Which flows are joint".

Short form: rigid_body
"""

import sys
import time

import numpy as np
from steps import STEPS, spec
from through_spec import long_enough, results, said

REPEATS = 7
MODELS = ("rigid_body", "maxwell_bloch", "sine_euler")
SCHEMES = ("splitting", "splitting_joint_lie", "splitting_joint")
AREAS = ("splitting_areas", "splitting_joint_areas")  # of the rigid body alone: they take long to compile
TWICE = {
    "noise_twice": ["drift 1", "noise 1/2 shared", "noise 1/2 shared"],
    "joint_twice": ["joint 1/2 shared", "joint 1/2 shared"],
}


def main():
    for model in sys.argv[1:] or MODELS:
        one = long_enough(spec(model, "splitting"), STEPS)
        areas = AREAS if model == "rigid_body" else ()
        wanted = {**one, "schemes": [*SCHEMES, *areas, *TWICE], "compositions": TWICE}
        results(wanted, samples=64)  # compiles
        found = []
        for _ in range(REPEATS):
            began = time.process_time()
            run = results(wanted)
            found.append([run[part].dataset.attrs["ns_per_step"] for part in run.parts])
            taken = time.process_time() - began
        ns = dict(zip(wanted["schemes"], np.min(found, axis=0), strict=True))
        print(f"{model}: said {said(wanted)[0].partition(',')[0]}; took {taken:.1f} s")
        for scheme, least in ns.items():
            print(f"  {scheme:24}{least:7.2f} ns")
        noise, joint = ns["noise_twice"] - ns["splitting"], ns["joint_twice"] - ns["splitting_joint_lie"]
        print(f"  flows of noises {noise:.2f} ns, joint flows {joint:.2f} ns: {joint / noise:.2f} times", flush=True)


if __name__ == "__main__":
    main()
