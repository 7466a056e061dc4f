"""What answers take over their accuracy: a smooth function, one with a kink, and an indicator.

    python benchmarks/accuracies.py [--accuracies 1e-2 1e-3 1e-4 1e-5 1e-6] [--seconds 3600]

prints a table: processor seconds of each answer, and s where it is solved for, m where it is sampled, ! where the
accuracy is not reached; in brackets the seconds that were predicted, where they were.  Compiling is left out.

Supports: docs/appendix/answer.md, "How long a solution takes".

Short form: --accuracies 1e-2
"""

import argparse
import math

import spi

MODEL = {"name": "maxwell_bloch", "sigma": [0.5, 0.5]}
FUNCTIONS = "y3^2", "abs(y3 + 1)", "(1 + (y3 - 0.3)/abs(y3 - 0.3))/2"


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--accuracies", type=float, nargs="*", default=[1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
    parser.add_argument("--functions", nargs="*", default=FUNCTIONS)
    parser.add_argument("--seconds", type=float, default=3600.0)
    asked = parser.parse_args()
    print("| function |", " | ".join(f"{one:g}" for one in asked.accuracies), "|")
    print("|---|" + "---:|" * len(asked.accuracies))
    for function in asked.functions:
        print(f"| `{function}` |", end="", flush=True)
        for accuracy in asked.accuracies:
            where = {"initial": [1, 2, 3], "final_time": 1, "seconds": asked.seconds, "progress": False}
            found = spi.answer(MODEL, function, accuracy=accuracy, **where)
            way = "s" if found.chosen is None else "m"
            said = f" ({found.predicted_seconds:.2g})" if math.isfinite(found.predicted_seconds) else ""
            print(f" {found.cpu_seconds:.2g} {way}{'' if found.reached else '!'}{said} |", end="", flush=True)
        print()


if __name__ == "__main__":
    main()
