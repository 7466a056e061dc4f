"""What a person is told of schemes that an estimator cannot do, and of an accuracy that is not reached."""

from dataclasses import replace

import pytest
from damage import call as command
from helpers import printed
from states import finished
from weak_cases import SPEC, case_of, plan_of

from spi.kinds.weak.results import not_reached
from spi.kinds.weak.study import remarks
from spi.plugins.comparisons.kinds.work_precision import study as work_precision
from spi.storage import StoredResults

KEYS = ("functions=y1^2", "steps=2^-1 .. 2^-3", "accuracy=1e-4")
BOTH = ("schemes=[splitting, euler_maruyama]", "estimators=[kolmogorov]", *KEYS)
TOLD = "kolmogorov cannot do euler_maruyama: there are no such results"


def of_kolmogorov(*keys, **options):
    """The case, the results of the splitting scheme without sampling, and what is printed of them."""
    case = case_of(*keys, **options)
    p = plan_of(case, "splitting", "kolmogorov")
    found = p.results(finished(p))
    return case, found, printed(StoredResults({"kind": "weak", "title": "Weak errors"}, (found.group(),)))


def test_schemes_that_an_estimator_cannot_do_are_told():
    case, found, text = of_kolmogorov(*BOTH)
    assert list(remarks(case)) == [TOLD] and text.count(TOLD) == 1
    assert found.left_out == ("euler_maruyama",)
    case, found, text = of_kolmogorov(*BOTH, "schemes=[splitting]")
    assert not list(remarks(case)) and "cannot do" not in text and found.left_out == ()
    assert not list(remarks(case_of(*BOTH, "estimators=[plain]")))
    both = case_of(*BOTH, "estimators=[kolmogorov, plain]")
    assert list(remarks(both)) == [TOLD]
    assert not list(work_precision.remarks(both))  # as there plain does what kolmogorov cannot do
    assert list(work_precision.remarks(case_of(*BOTH))) == [TOLD]


def test_the_check_tells(tmp_path):
    spec = tmp_path / "weak.yaml"
    spec.write_text(SPEC.read_text())
    code, out, _ = command("check", spec, *(word for key in BOTH for word in ("--set", key)))
    assert code == 0 and out.splitlines()[-1].endswith(TOLD)
    code, out, _ = command("check", spec)
    assert code == 0 and len(out.splitlines()) == 1


@pytest.mark.parametrize("system", ["rigid_body", "maxwell_bloch"])
def test_an_accuracy_that_is_not_reached_is_told(system):
    keys = (*BOTH, "schemes=[splitting]", *["model.sigma=[0.1, 0.1]"] * (system == "maxwell_bloch"))
    case, found, text = of_kolmogorov(*keys, system=system)
    assert not list(remarks(case)) and "not reached" not in text and not not_reached(found)
    line = "accuracy 1e-18 will not be reached: rounding errors are about "
    assert [one[: len(line)] for one in remarks(case.model_copy(update={"accuracy": 1e-18}))] == [line]
    bounds = found.unsampled.error_bound.max(), found.unsampled.expectation_bound.max()
    wanted = replace(found, accuracy=bounds[0] * (1 - 1e-9))
    assert not_reached(wanted).startswith("accuracy ") and "is not reached: errors are known to" in not_reached(wanted)
    group = wanted.group()
    assert not_reached(wanted) in printed(StoredResults({"kind": "weak", "title": "Weak errors"}, (group,)))
    assert not not_reached(replace(found, accuracy=max(bounds)))
