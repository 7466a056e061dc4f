"""What results are called."""

import pytest

from spi.specs.naming import results_name


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("laptop",), "x"),
        (("quick",), "x.quick"),
        (("laptop", ["seed=2"]), "x.seed=2"),
        (("laptop", ["--seed=2"]), "x.seed=2"),
        (("laptop", ["seed=1", " seed = 2"]), "x.seed=2"),  # the last one counts, spaces do not
        (("quick", ["seed=2", "model.sigma=[1, 0, 0]"]), "x.quick.model.sigma=1,0,0.seed=2"),
        (("quick", ["model.sigma=[1,0,0]", "--seed=2"]), "x.quick.model.sigma=1,0,0.seed=2"),
        (
            ("laptop", ["damping=0.5", "--samples=9", "cases.a.samples=3", "expect.splitting={order: 1}"]),
            "x.damping=0.5",
        ),
        (("laptop", ["title=T", "asks=Q", "figure=3", "expect=null", "cases.a.title=t"]), "x"),
    ],
)
def test_a_name_tells_what_decides_the_paths(options, expected):
    assert results_name("x", *options) == expected


def test_what_a_file_name_cannot_hold_is_told_apart_by_a_digest():
    texts = ["2^-5", "2^-6", "2^-5 .. 2^-6", "../../etc", "A", "a", "$(rm)", "é", "\udcff", "x" * 200, "x" * 201, ""]
    names = {results_name("x", "laptop", [f"steps={text}"]) for text in texts}
    names |= {results_name("x", "laptop", [f"T={text}", f"t={text}"]) for text in texts}
    assert len({name.lower() for name in names}) == 2 * len(texts)
    for name in names:
        assert name.isascii() and not set(name) & set("/\\:*?\"<>|^$()[]{}' ") and len(name) < 100, name
    many = [f"k{n}={n}" for n in range(40)]
    assert results_name("x", "quick", many).startswith("x.quick.set-") != results_name("x", "quick", many[1:])
