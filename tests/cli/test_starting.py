"""How a person begins: names instead of files, spi list, spi new, and what a shell completes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from damage import call, refusal
from strong_results import strong, strong_group

from spi import storage
from spi.cli import showing
from spi.kinds import KINDS
from spi.plugins import offers
from spi.running import shipped
from spi.running.run import load
from spi.specs import SpecError

NAMES = sorted(path.stem for path in (Path(__file__).parents[2] / "experiments").glob("*.yaml"))


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


# --- names instead of files -----------------------------------------------------------------------------------------


def test_experiments_that_come_with_the_program_are_found_by_name():
    assert shipped.names() == NAMES
    Path("maxwell_bloch_strong").mkdir()  # a folder of that name is no experiment
    assert load("maxwell_bloch_strong").name == "maxwell_bloch_strong"
    code, out, err = call("check", "rigid_body_strong")
    assert (code, err) == (0, "") and out.startswith("rigid_body_strong: valid")
    assert refusal("check", "rigid_body_strong", "--seed=x").startswith("spi: rigid_body_strong: --seed: seed: is 'x'")
    path = shipped.path_of("rigid_body_strong")  # what is given by its path is called by it
    assert refusal("check", str(path), "--seed=x").startswith(f"spi: {path}: --seed")
    Path("rigid_body_strong").write_text("kind: nonsense")  # a file of that name goes first
    assert refusal("check", "rigid_body_strong").startswith("spi: rigid_body_strong:1: kind: is 'nonsense'")
    Path("rigid_body_strong").unlink()
    assert refusal("merge", "rigid_body_strong") == (
        f"spi: {Path('results/sums')}: no shards of rigid_body_strong here; "
        "`spi run rigid_body_strong --shard 1/4` computes the first of four\n"
    )
    assert refusal("answer", "rigid_body_strong", "--seed=x").startswith("spi: rigid_body_strong.answer: --seed")
    assert refusal("answer", str(path), "--seed=x").startswith(f"spi: {path.parent}")


@pytest.mark.parametrize("name", ["rigid_body_stron", "rigid_body_stron.yaml"])
def test_an_unknown_name_gets_the_nearest_known_one(name):
    meant = "did you mean rigid_body_strong, which comes with spi? `spi list` shows all that do"
    assert refusal("run", name) == f"spi: {name}: no such file; {meant}\n"


def test_a_name_like_none_that_is_known_gets_the_list():
    Path("t.yaml").write_text("")
    assert refusal("run", "xyzzy").endswith("give the path of a YAML file or a name that `spi list` shows\n")


@pytest.mark.parametrize("command", ["run", "check", "merge", "model"])
def test_a_command_without_its_experiment_says_what_to_give(command):
    message = refusal(command)
    assert "'SPEC'" in message and "`spi list`" in message and f"`spi {command} --help`" in message


def test_stored_results_are_found_by_name():
    for command in ("show", "plot", *offers("commands").keys() & {"verify"}):
        assert refusal(command, "mine").startswith("spi: results/mine.h5: no such file; give a file of results")
        missing = "spi: results/rigid_body_strong.h5: no such file; `spi run rigid_body_strong` writes it\n"
        assert refusal(command, "rigid_body_strong") == missing
    storage.write("results/mine.h5", strong(strong_group("splitting")))
    assert refusal("show", "mime") == "spi: results/mime.h5: no such file; did you mean mine?\n"
    assert call("show", "mine") == call("show", "results/mine.h5")
    assert call("show", "mine")[0] == 0
    Path("mine").mkdir()  # a folder of that name holds no results
    assert call("show", "mine")[0] == 0
    Path("mine").rmdir()
    storage.write("other/mine.h5", strong(strong_group("splitting", case_title="of the other folder")))
    assert call("plot", "mine", "--results", "other")[0] == 0
    assert sorted(path.name for path in Path("other").iterdir()) == ["mine.h5", "mine.pdf", "mine.png"]
    Path("mine").write_bytes(Path("results/mine.h5").read_bytes())  # a file of that name goes first
    Path("results/mine.h5").write_text("damaged")
    assert call("show", "mine")[0] == 0


# --- help -----------------------------------------------------------------------------------------------------------


def test_help_fits_80_columns_and_no_command_is_told_by_half_a_sentence(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = call("--help")
    assert (code, err) == (0, "")
    commands = re.findall(r"^  ([a-z]+) +[A-Z]\S* ", out, re.MULTILINE)
    assert {"run", "list", "new", "plot", "show", "check", "doctor", *offers("commands")} <= set(commands)
    assert re.findall(r"^(\S.*):$", out, re.MULTILINE) == ["Options", "Begin", "Compute", "Look at results", "More"]
    assert "...\n" not in out.partition("Options:")[2] and max(map(len, out.splitlines())) <= 80
    for command in commands:
        code, page, err = call(command, "--help")
        assert (code, err) == (0, "") and page.startswith(f"Usage: spi {command}")
        assert max(map(len, page.splitlines())) <= 80 and "\x1b" not in page and "...\n" not in page.partition("\n")[2]
        examples = re.findall(rf"^    spi {command} .*", page.partition("Examples:")[2], re.MULTILINE)
        assert len(examples) == 2 * (command in ("run", "answer", "plot", "study", "export"))


# --- spi list -------------------------------------------------------------------------------------------------------


@pytest.mark.needs("systems", "comparisons", "dynamics")  # which have experiments and groups of their own
def test_a_list_that_is_read_by_a_program_has_a_record_a_line_with_its_whole_title():
    """What a terminal shows is tried in test_terminal.py."""
    code, out, err = call("list")
    assert (code, err) == (0, "") and "\x1b" not in out
    for name in (*NAMES, "lotka_volterra", "splitting_order2", "lyapunov", "strong"):
        assert re.search(rf"^\w+ +{name}( |$)", out, re.MULTILINE), name
    assert re.search("^dynamics .* Positivity, stochastic Lotka-Volterra system$", out, re.MULTILINE)
    assert not list(Path().iterdir())
    parts = [call("list", part)[1] for part in ("experiments", "models", "schemes", "kinds")]
    assert "".join(parts) == out and call("list", "paper")[1].count("\n") == 17
    assert "'flows'" in refusal("list", "flows") and "no results here" in refusal("list", "results")


def test_experiments_of_ones_own_are_listed_beside_the_others():
    Path("experiments").mkdir()
    Path("experiments/mine.yaml").write_bytes(shipped.path_of("toda_weak").read_bytes())  # whose model is not looked at
    Path("experiments/bad.yaml").write_text("kind: waek")
    code, out, err = call("list", "experiments")
    assert code == 2 and "experiments/mine.yaml" in out and "bad" not in out and "rigid_body_weak" in out
    assert err.startswith("spi: experiments/bad.yaml:1: kind: is 'waek'; did you mean 'weak'?") and err.count("\n") == 1


def test_experiments_are_not_listed_twice_where_they_lie(monkeypatch):
    monkeypatch.chdir(shipped.folder().parent)
    out = call("list", "experiments", "--experiments", str(shipped.folder()))[1]
    assert len(re.findall(r" rigid_body_weak2\w*  ", out)) == 2  # with rigid_body_weak2_strong_noise


# --- spi new --------------------------------------------------------------------------------------------------------


def switched_off(lines):
    """The places (first, behind last) of the keys that are behind "# ", with the lines that belong to them."""
    found = []
    for n, line in enumerate(lines):
        if re.match(r" *# \w+:( |$)", line):
            indent = line.index("#")
            end = next(
                (m for m in range(n + 1, len(lines)) if not re.match(rf" {{{indent}}}#   +\S", lines[m])), len(lines)
            )
            found.append((n, end))
    return found


def switched_on(lines, blocks):
    """The text with these keys in use."""
    within = {n for first, end in blocks for n in range(first, end)}
    return "\n".join(line.replace("# ", "", 1) if n in within else line for n, line in enumerate(lines))


@pytest.mark.parametrize(
    ("options", "keys"), [((), 6), pytest.param(("--system",), 3, marks=pytest.mark.needs("systems"))]
)
def test_a_new_experiment_is_valid_and_so_is_each_key_that_it_has_switched_off(options, keys):
    code, out, err = call("new", "mine", *options)
    assert (code, out) == (0, "") and err.startswith("wrote mine.yaml\nspi: ") and "spi run mine.yaml" in err
    code, out, _ = call("check", "mine.yaml")
    assert code == 0 and out.startswith("mine.yaml: valid")
    text = Path("mine.yaml").read_text()
    assert "NAME" not in text and "spi plot mine.yaml" in text and max(map(len, text.splitlines())) <= 120
    lines = text.splitlines()
    blocks = switched_off(lines)
    assert len(blocks) == keys
    for chosen in ([block] for block in blocks):
        Path("mine.yaml").write_text(switched_on(lines, chosen))
        assert load("mine.yaml").effective
    Path("mine.yaml").write_text(switched_on(lines, blocks))
    assert load("mine.yaml").name == "mine"
    wrong = [line.replace("# ", "# x", 1) if n == blocks[0][0] else line for n, line in enumerate(lines)]
    Path("mine.yaml").write_text(switched_on(wrong, blocks[:1]).replace("# x", "x", 1))
    with pytest.raises(SpecError, match="not a known key"):  # so the keys are really switched on
        load("mine.yaml")


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_experiment_of_each_kind_is_valid_and_names_all_keys(kind):
    code, _, err = call("new", "mine", "--kind", kind)
    assert code == 0 and err.startswith("wrote mine.yaml\n")
    assert call("check", "mine.yaml")[0] == 0
    text = Path("mine.yaml").read_text()
    assert load("mine.yaml").kind == kind and max(map(len, text.splitlines())) <= 120 and "NAME" not in text
    if kind != "strong":  # which has some keys only, with examples
        assert {*re.findall(r"^(?:# )?(\w+):", text, re.MULTILINE)} >= {*KINDS[kind].keys.Case.model_fields} - {"name"}


def test_an_unknown_kind_or_group_is_told_with_what_is_near():
    assert "--kind: 'wek' is not a kind of experiment here; did you mean 'weak'?" in refusal(
        "new", "a", "--kind", "wek"
    )
    assert "--kind and --from" in refusal("new", "a", "--kind", "weak", "--from", "b").replace(
        "from and --kind", "kind and --from"
    )
    assert "'papr' is not a group of experiments; did you mean 'paper'?" in refusal("run", "--group", "papr")


def test_a_group_is_all_of_its_experiments():
    paper = showing.members("paper")
    figures = [shipped.path_of(name).read_text(encoding="utf-8") for name in paper]
    assert [int(re.search(r"^figure: (\d+)", text, re.MULTILINE)[1]) for text in figures] == [*range(1, 18)]
    with pytest.raises(SpecError, match="there is no folder experiments"):
        showing.members("yours")
    Path("experiments").mkdir()
    Path("experiments/mine.yaml").write_bytes(shipped.path_of("rigid_body_strong").read_bytes())
    assert showing.members("yours") == [Path("experiments/mine.yaml")]


def test_the_beginning_of_a_name_is_enough_to_be_told_what_is_meant():
    told = "did you mean rigid_body_ap_failure, rigid_body_ap_invariants or rigid_body_ap_trajectories?"
    assert told in refusal("show", "rigid")
    Path("results").mkdir()
    Path("results/rigid_mine.h5").write_bytes(b"")
    assert "did you mean rigid_mine?" in refusal("show", "rigid")


@pytest.mark.needs("systems")
def test_a_new_experiment_from_another_has_its_comments_and_its_files():
    code, _, err = call("new", "sub/top.yaml", "--from", "heavy_top_strong")
    assert code == 0 and err.splitlines()[:2] == ["wrote sub/top.yaml", "wrote sub/systems/heavy_top.yaml"]
    assert Path("sub/top.yaml").read_bytes() == shipped.path_of("heavy_top_strong").read_bytes()
    copied = load("sub/top.yaml")
    assert copied.hash == load("heavy_top_strong").hash
    assert call("new", "sub/weak", "--from", "heavy_top_weak")[0] == 0  # the same system exists already
    Path("sub/systems/heavy_top.yaml").write_text("algebra: so(3)\n")
    before = sorted(Path().rglob("*"))
    assert "sub/systems/heavy_top.yaml: already exists" in refusal("new", "sub/other", "--from", "heavy_top_weak")
    assert sorted(Path().rglob("*")) == before


def test_nothing_is_overwritten_and_odd_names_are_refused():
    Path("mine.yaml").write_text("precious")
    for options in ((), ("--from", "rigid_body_strong")):
        assert "mine.yaml: already exists" in refusal("new", "mine", *options)
    Path("gone.yaml").symlink_to("nowhere")
    assert "gone.yaml: already exists" in refusal("new", "gone")
    for name in ("", "a/", "a\nb", "/"):
        assert "is not a file name" in refusal("new", name)
    assert "did you mean rigid_body_strong" in refusal("new", "other", "--from", "rigid_body_stron")
    assert "'NAME'" in refusal("new")
    assert sorted(path.name for path in Path().iterdir()) == ["gone.yaml", "mine.yaml"]
    assert Path("mine.yaml").read_text() == "precious"


@pytest.mark.needs("systems")
def test_a_template_overwrites_nothing_and_excludes_another_experiment():
    Path("mine.yaml").write_text("precious")
    assert "mine.yaml: already exists" in refusal("new", "mine", "--system")
    message = "--from and --system exclude one another; give one of them"
    assert message in refusal("new", "other", "--system", "--from", "rigid_body_strong")
    assert [path.name for path in Path().iterdir()] == ["mine.yaml"]
    assert Path("mine.yaml").read_text() == "precious"


def test_commands_to_copy_are_quoted_where_a_name_has_blanks():
    code, _, err = call("new", "my body")
    assert code == 0 and "`spi check 'my body.yaml'`" in err and "`spi run 'my body.yaml'`" in err
    assert "spi plot 'my body.yaml'" in Path("my body.yaml").read_text()
    code, _, err = call("new", "my_body")
    assert code == 0 and "`spi run my_body.yaml`" in err


def test_a_file_that_cannot_be_written_is_told_without_options_that_the_command_lacks():
    Path("file").write_text("")
    message = refusal("new", "file/mine")
    assert "cannot write file/mine.yaml" in message and "--out" not in message


# --- what a shell completes -----------------------------------------------------------------------------------------

WITHOUT_HEAVY_IMPORTS = """
import sys
from spi.cli import main
try:
    main()
finally:
    print(*sorted({"numba", "numpy", "yaml", "h5py"} & set(sys.modules)), file=sys.stderr)
"""


def completed(line):
    """What bash is offered for the last word of a command line."""
    words = line.split(" ")
    variables = {"_SPI_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_HEAVY_IMPORTS],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "\n")
    return done.stdout.split()


def test_names_and_files_are_completed_and_nothing_heavy_is_imported():
    Path("results").mkdir()
    Path("results/toda_mine.h5").touch()
    Path("toda_own.yaml").touch()
    Path("toda.txt").touch()
    assert completed("spi run toda") == ["toda_strong", "toda_trajectory", "toda_weak", "toda_own.yaml"]
    assert completed("spi show toda") == ["toda_mine"]
    assert completed("spi plot results/") == ["results/toda_mine.h5"]
    assert completed("spi run rigid_body_strong --profile q") == ["quick"]
    assert completed("spi new own --from heavy_top_s") == ["heavy_top_strong"]
    assert completed("spi run nowhere/x") == []
    assert completed("spi do") == ["doctor"]
