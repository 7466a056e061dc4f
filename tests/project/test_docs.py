"""The documentation: every command and every block of YAML or Python in it is what the program knows."""

import shlex

import pytest
from damage import call
from documents import PAGES, ROOT, blocks_of, check_page, missing_lines, page_name

OUTPUTS = [
    pytest.param(block, id=block.place)
    for page in PAGES
    for block in blocks_of(page, page.read_text(encoding="utf-8"))
    if "output of" in block.notes
]


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    """The reader's folder: the experiments, the model of the examples, and what the tutorial has made by `spi new`."""
    tmp_path.joinpath("experiments").symlink_to(ROOT / "experiments")
    tmp_path.joinpath("systems").symlink_to(ROOT / "experiments" / "systems")
    tmp_path.joinpath("schemes").symlink_to(ROOT / "experiments" / "schemes")
    tmp_path.joinpath("my_top.py").symlink_to(ROOT / "tests" / "heavy_top.py")
    page = ROOT / "docs" / "own_functions.md"
    (example,) = [
        block for block in blocks_of(page, page.read_text(encoding="utf-8")) if "compiled only" in block.notes
    ]
    tmp_path.joinpath("my_functions.py").write_text(example.text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for name, options in (("my_body", []), ("my_top", ["--system"])):
        assert call("new", name, *options)[0] == 0


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_blocks_and_commands(page):
    check_page(page, page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("block", OUTPUTS)
def test_output_is_that_of_the_command(block):
    _, out, err = call(*shlex.split(block.notes["output of"])[1:])
    assert missing_lines(block.text, out + err) == []
