"""Functions that name t, the time at which a state is looked at, beside those that do not."""

import numpy as np

from spi import storage
from spi.running.run import run

START = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [0.5, 0.5, 0.5]}
initial: [0.6, 0, 0.8]
schemes: [splitting]
"""
TRAJECTORY = START + "kind: trajectory\nstep: 2^-4\nfinal_time: 1\npanels: [functions]\n"
WEAK = START + "kind: weak\nsteps: [2^-3]\nreference_step: 2^-6\nfinal_time: 2\nsamples: 64\nestimators: [plain]\n"


def test_functions_along_a_path(spec, tmp_path):
    text = TRAJECTORY + "functions: {b: 2*cos(0.1*t), moved: t*y1 + H, sum: sum(y(t)*t for t = 1..3)}\n"
    group = storage.read(run(spec(text), tmp_path, fresh=True)).groups[0]
    y, h, values = (group.variables[name][1] for name in ("y", "hamiltonian", "value"))
    t = np.linspace(0, 1, 17)
    np.testing.assert_allclose(values, [2 * np.cos(0.1 * t), t * y[:, 0] + h, y @ [1, 2, 3]], rtol=1e-14)
    assert "t*y1 + H" in str(group.attributes.values())


def test_weak_errors_have_the_final_time(spec, tmp_path):
    one, other = (
        storage.read(run(spec(WEAK + f"functions: {{phi: {phi}}}\n"), tmp_path, fresh=True)).groups[0].variables
        for phi in ("y1 + t^2*y2", "y1 + 4*y2")
    )
    np.testing.assert_array_equal(one["error"][1], other["error"][1])
    assert np.all(one["error"][1] != 0)


def test_where_t_has_no_meaning(error):
    section = "section: {of: y1 - t, store: [y1]}\n"
    assert "section.of: is 'y1 - t' (it names t, and a section is a surface of states)" in error(
        TRAJECTORY.replace("functions]", "section]") + section
    )
    assert "functions.phi: is 't^2' (constant)" in error(WEAK + "functions: {phi: t^2}\n")
