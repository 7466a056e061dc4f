"""What results are called."""

import re

import pytest

from spi.specs.naming import results_name


@pytest.mark.parametrize(
    ("options", "same"),
    [
        (("laptop", ["--seed=2"]), ("laptop", ["seed=2"])),
        (("laptop", ["seed=1", " seed = 2"]), ("laptop", ["seed=2"])),  # the last one counts, spaces do not
        (("quick", ["seed=2", "model.sigma=[1, 0, 0]"]), ("quick", ["model.sigma=[1,0,0]", "--seed=2"])),
        (("laptop", ["damping=0.5", "--samples=9", "cases.a.samples=3"]), ("laptop", ["damping=0.5"])),
        (("laptop", ["damping=0.5", "expect.splitting={order: 1}"]), ("laptop", ["damping=0.5"])),
        (("laptop", ["title=T", "asks=Q", "figure=3", "expect=null", "cases.a.title=t"]), ("laptop", [])),
        (("quick", ["--samples=9"]), ("quick",)),
    ],
)
def test_a_name_tells_what_decides_the_paths(options, same):
    name = results_name("x", *options)
    assert name == results_name("x", *same) != results_name("x", "quick", ["seed=3"])
    assert re.fullmatch(r"x([.]quick)?([.][0-9a-f]{6})?", name)
    assert (results_name("x"), results_name("x", "quick")) == ("x", "x.quick")


def test_overrides_that_differ_have_names_that_do():
    texts = ["2^-5", "2^-6", "2^-5 .. 2^-6", "../../etc", "A", "a", "$(rm)", "é", "\udcff", "x" * 200, "x" * 201, ""]
    names = {results_name("x", "laptop", [f"steps={text}"]) for text in texts}
    names |= {results_name("x", "laptop", [f"T={text}", f"t={text}"]) for text in texts}
    assert len(names) == 2 * len(texts)
