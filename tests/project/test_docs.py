"""The documentation: every command and every block of YAML or Python in it is what the program knows."""

import shlex
from pathlib import Path

import pytest
from damage import call
from documents import (
    PAGES,
    ROOT,
    Wrong,
    blocks_of,
    changed,
    check_command,
    check_page,
    check_yaml,
    commands_in,
    commands_of,
    missing_lines,
    page_name,
)
from helpers import COMPILED

TUTORIAL = ROOT / "docs" / "tutorial.md"  # whose commands need what those before them wrote
OTHERS = [page for page in PAGES if page != TUTORIAL]

#: A run that takes no time, with the kernels that the other tests compile.
TINY = ["--profile", "quick", "--samples", "9", "--set", "schemes=[euler_maruyama, splitting]", "--set", "expect=null"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder in which the reader of a page works: with the experiments, and with the model of the examples."""
    tmp_path.joinpath("experiments").symlink_to(ROOT / "experiments")
    tmp_path.joinpath("systems").symlink_to(ROOT / "experiments" / "systems")
    tmp_path.joinpath("schemes").symlink_to(ROOT / "experiments" / "schemes")
    tmp_path.joinpath("my_top.py").symlink_to(ROOT / "tests" / "heavy_top.py")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def spi(folder):
    """spi(argument, ...) -> (exit code, all that it prints)."""

    def said(*arguments):
        code, out, err = call(*arguments)
        return code, out + err

    return said


@pytest.mark.parametrize("page", OTHERS, ids=page_name)
def test_blocks_and_commands(page, folder):
    check_page(page, page.read_text(encoding="utf-8"))


SPEC = ROOT.joinpath("experiments", "lotka_volterra_positivity.yaml").read_text(encoding="utf-8")
GOOD = f"""
See `spi plot FILE` and `spi run --shard`; `results.plot()` is no command, and neither is `import spi`.

```yaml
{SPEC}```

<!-- within: rigid_body_strong -->
```yaml
samples: 10^4
```

<!-- within: spin_ring_strong, model -->
```yaml
system: systems/spin_ring.yaml
sizes: {{n: 3}}
```

```sh
make demo
spi run lotka_volterra_positivity --set seed=2 --max-time 3h    # the experiment
seq 4 | parallel spi run SPEC --shard {{}}/4
```

```python
assert 1 + 1 == 2
```
"""


def test_a_page_without_mistakes(folder):
    check_page(Path("page.md"), GOOD)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("kind: trajectory", "kind: trajectory\nsamplse: 3", "page.md:4: block_4.yaml:.*samplse"),
        ("samples: 10^4", "samples: 0", "page.md:.*samples"),
        ("samples: 10^4", "smaples: 10", "page.md:.*smaples"),
        ("sizes: {n: 3}", "sises: {n: 3}", "(?s)page.md:.*sises"),
        ("<!-- within: rigid_body_strong -->", "", "is no whole spec"),
        ("--max-time", "--maxtime", "no such option: --maxtime"),
        ("--set seed=2", "--set sede=2", "sede"),
        ("--shard {{}}/4", "--prat {{}}/4", "--prat"),
        ("spi run lotka_volterra_positivity", "spi run lotka_volterra", "lotka_volterra: no such file"),
        ("spi run lotka", "spi ran lotka", "no such command"),
        ("make demo", "mkae demo", "calls none of spi, make"),
        ("`spi plot FILE`", "`spi plot FILE --flim`", "no such option: --flim"),
        ("`spi run --shard`", "`spi rnu --shard`", "no such command"),
        ("`spi plot FILE`", "`spi plot results/rigid_bdoy_strong.h5`", "no experiment is called rigid_bdoy_strong"),
        ("1 + 1 == 2", "1 + 1 == 3", "page.md"),
        ("1 + 1 == 2", "1 + 1 === 2", "page.md"),
        ("```python", "```pyhton", "has the language pyhton"),
    ],
)
def test_a_mistake_in_a_page_is_noticed(folder, right, wrong, message):
    right, wrong = right.replace("{{}}", "{}"), wrong.replace("{{}}", "{}")
    assert right in GOOD
    with pytest.raises(Wrong, match=message):
        check_page(Path("page.md"), GOOD.replace(right, wrong, 1))


def outputs():
    for page in OTHERS:
        for block in blocks_of(page, page.read_text(encoding="utf-8")):
            if "output of" in block.notes:
                yield pytest.param(block, id=block.place)


def check_output(block, spi):
    """Wrong unless a command says what the block shows."""
    _, said = spi(*shlex.split(block.notes["output of"])[1:])
    if missing := missing_lines(block.text, said):
        raise Wrong(f"{block.place}: not said: {missing}")


@pytest.mark.parametrize("block", [*outputs()])
def test_output_is_that_of_the_command(spi, block):
    check_output(block, spi)


def test_other_output_is_noticed():
    said = "heavy_top:\n  6 variables\n  noise 1: G3: 2 shears\n"
    assert missing_lines("heavy_top:\n... variables\n", said) == []
    assert missing_lines("heavy_top:\n  7 variables\n", said) == ["  7 variables"]
    assert missing_lines("  noise 1: …\nheavy_top:\n", said) == ["heavy_top:"]  # the order counts


def follow(page, text, spi):
    """Do what a page says, from its beginning to its end; only runs of its own experiments are not computed."""
    for block in blocks_of(page, text):
        for command in commands_in(block):
            verb, *rest = command.arguments
            check_command(command)
            if verb == "run" and rest == ["rigid_body_strong"]:
                rest += TINY
            elif verb in ("run", "plot") and rest != ["rigid_body_strong"]:
                continue
            code, said = spi(verb, *rest)
            if rest[1:] == TINY:  # what it wrote, under the name that the page tells
                next(Path("results").glob("*.h5")).rename(f"results/{rest[0]}.h5")
            if code:
                raise Wrong(f"{command.place}: {verb} ends with exit code {code}: {said}")
        if "in file" in block.notes:
            path = Path(block.notes["in file"])
            path.write_text(changed(block, path.read_text(encoding="utf-8")), encoding="utf-8")
        elif "output of" in block.notes:
            check_output(block, spi)
        elif block.language == "yaml":
            check_yaml(block)
    for command in commands_of(page, text):
        check_command(command)


@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
def test_tutorial_can_be_followed(spi):
    follow(TUTORIAL, TUTORIAL.read_text(encoding="utf-8"), spi)
    assert "sigma: [1, 0, 0]" in Path("my_body.yaml").read_text(encoding="utf-8")
    assert Path("results/rigid_body_strong.png").is_file()


def test_a_mistake_in_a_tutorial_is_noticed(spi):
    """A line that the file does not have, and an experiment that was not written."""
    page = "<!-- in file: experiments/rigid_body_strong.yaml -->\n```yaml\nsamplse: 3\n```\n"
    with pytest.raises(Wrong, match="0 lines of the file begin with 'samplse:'"):
        follow(Path("page.md"), page, spi)
    with pytest.raises(Wrong, match="my_bodi"):
        follow(Path("page.md"), "```sh\nspi run my_bodi.yaml\n```\n", spi)
    with pytest.raises(Wrong, match="exit code 2"):
        follow(Path("page.md"), "```sh\nspi show rigid_body_strong.h5\n```\n", spi)
