"""What every test costs, for ``python -m pytest --costs FILE``, and a summary of such a file.

    python tests/costs.py FILE [TESTS]

prints processor seconds by room, and those of the costliest tests.  FILE gets a line of JSON for each test: seconds
of wall clock, processor seconds of its process and of programs that it starts, how many kernels were compiled, and the
processor seconds of that.  Fixtures of a module count for the first test that asks for them.
"""

import json
import resource
import sys
import time
from collections import defaultdict
from pathlib import Path

import pytest


def program_seconds():
    """Processor seconds of all programs that this process has started and waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


class Costs:
    """A plugin that appends a line for each test; it serves each of the processes that share the tests."""

    def __init__(self, file):
        self.file, self.compiled, self.seconds, self.depth, self.began = file, [], 0.0, 0, 0.0

    def pytest_sessionstart(self):
        from numba.core import event  # after conftest.py has said where kernels are kept

        costs = self

        class Compiling(event.Listener):
            def on_start(self, found):
                if costs.depth == 0:
                    costs.began = time.process_time()
                costs.depth += 1

            def on_end(self, found):
                costs.depth -= 1
                if costs.depth == 0:  # what compiles for another counts as the other
                    costs.seconds += time.process_time() - costs.began
                    costs.compiled.append(found.data["dispatcher"].py_func.__qualname__)

        event.register("numba:compile", Compiling())

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        self.compiled, self.seconds = [], 0.0
        wall, processor, programs = time.perf_counter(), time.process_time(), program_seconds()
        yield
        row = {
            "id": item.nodeid,
            "wall": time.perf_counter() - wall,
            "processor": time.process_time() - processor,
            "programs": program_seconds() - programs,
            "compiling": self.seconds,
            "kernels": self.compiled,
        }
        with open(self.file, "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def summary(rows, tests):
    """Two tables: processor seconds by room, and of the costliest tests, cases of one function together."""
    rooms, functions = defaultdict(lambda: [0, 0.0, 0.0, 0.0, 0]), defaultdict(lambda: [0, 0.0, 0.0, 0.0, 0])
    for row in rows:
        name = row["id"].partition("[")[0].removeprefix("tests/")
        cost = 1, row["processor"] + row["programs"], row["programs"], row["compiling"], len(row["kernels"])
        for table, key in ((rooms, name.partition("/")[0]), (rooms, "all"), (functions, name)):
            table[key] = [a + b for a, b in zip(table[key], cost, strict=True)]
    for title, table, most in (("room", rooms, None), ("test", functions, tests)):
        yield f"| {title} | tests | processor s | of programs | of compiling | kernels |"
        yield "|---|---:|---:|---:|---:|---:|"
        for key, (n, total, programs, compiling, kernels) in sorted(table.items(), key=lambda e: -e[1][1])[:most]:
            yield f"| {key} | {n} | {total:.1f} | {programs:.1f} | {compiling:.1f} | {kernels} |"


if __name__ == "__main__":
    lines = Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()
    print(*summary(map(json.loads, lines), int(sys.argv[2]) if len(sys.argv) > 2 else 30), sep="\n")
