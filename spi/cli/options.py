"""Arguments and options of several commands, with their completion; exit codes; the end of a command."""

import functools
import inspect
import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn

import typer

from ..plugins import PluginError, imported, offers
from ..specs.figures import FIGURE_KEYS
from .terminal import STOP, tell

RESULTS = Path("results")  #: the folder of results unless --out names another
SPECS = (".yaml", ".yml")


def complete_spec(incomplete: str) -> list[str]:
    """Names of the experiments that come with the program, and spec files."""
    from ..running import shipped

    return [name for name in shipped.names() if name.startswith(incomplete)] + _files(incomplete, SPECS)


def complete_results(incomplete: str) -> list[str]:
    """Names of results in ./results, and files of results."""
    names = sorted(path.stem for path in RESULTS.glob("*.h5"))
    return [name for name in names if name.startswith(incomplete)] + _files(incomplete, [".h5"])


def complete_profile(incomplete: str) -> list[str]:
    """Profiles of a spec, without what reads them: that takes a while."""
    return [name for name in ("laptop", "paper", "quick") if name.startswith(incomplete)]


def _files(incomplete: str, endings: Sequence[str]) -> list[str]:
    """Files with these endings whose paths begin so; where there are none, a shell offers all files and folders."""
    folder, start = os.path.split(incomplete)
    try:
        names = sorted(name for name in os.listdir(folder or ".") if name.startswith(start))
    except OSError:
        return []
    return [os.path.join(folder, name) for name in names if name.endswith(tuple(endings))]


if TYPE_CHECKING:
    from ..running.finding import Found
    from ..running.run import Limits, Watch
    from ..specs import Experiment

DONE, FAILED, INVALID, STOPPED, CLAIM_FAILED = 0, 1, 2, 3, 4

_SPECS = typer.Argument(
    metavar="SPEC",
    help="Experiment files (YAML), names listed by `spi list`, or files of results, whose spec and options count.",
    autocompletion=complete_spec,
)
Specs = Annotated[list[Path], _SPECS]
SeveralSpecs = Annotated[list[Path] | None, _SPECS]
ResultsFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE|SPEC|NAME",
        help="A file of results, or an experiment that was run, with the options of the run.",
        autocompletion=complete_results,
    ),
]
Several = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="FILE|SPEC|NAME",
        help="Files of results, or experiments that were run, with the options of the runs (default: all results).",
        autocompletion=complete_results,
    ),
]
Out = Annotated[Path, typer.Option(help="Folder of results.")]
ResultsFolder = Annotated[Path, typer.Option("--results", help="Folder of results.")]
Threads = Annotated[int | None, typer.Option(help="Threads (default: all).", min=1)]
Fresh = Annotated[bool, typer.Option("--fresh", help="Recompute from scratch, whatever is there already.")]


class RunOptions(NamedTuple):
    """Options of a run, which also choose among the results of its experiment."""

    profile: Annotated[
        str | None,
        typer.Option(help="laptop (the file itself, the default), paper or quick.", autocompletion=complete_profile),
    ] = None
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the spec.")
    ] = None
    samples: Annotated[str | None, typer.Option(help="Number of paths; short for --set samples=N.")] = None
    seed: Annotated[str | None, typer.Option(help="Seed; short for --set seed=S.")] = None
    trust_code: Annotated[
        bool,
        typer.Option(
            "--trust-code",
            help="Run Python code that a file of results holds, though no file here equals it; only if you trust it.",
        ),
    ] = False

    @property
    def assignments(self) -> list[str]:
        """Overrides of a spec by --set, --samples and --seed."""
        short = {"samples": self.samples, "seed": self.seed}
        return [*(self.overrides or ()), *(f"--{key}={value}" for key, value in short.items() if value is not None)]


class Command(NamedTuple):
    """A command, its place in `spi --help`, and examples in its own help."""

    run: Callable[..., None]
    panel: str
    examples: Sequence[str] = ()
    cls: Any = None  #: what reads its arguments, where it is not typer's own class

    def add_to(self, app: typer.Typer, name: str) -> None:
        """Make it a command of `spi`."""
        lines = "\n".join(["Examples:", *(f"  {line}" for line in self.examples)])
        style = {"rich_help_panel": self.panel, "epilog": f"\b\n{lines}" if self.examples else None, "cls": self.cls}
        app.command(name, **style)(self.run)


#: Panels of `spi --help`.
BEGIN, COMPUTE, LOOK, MORE = "Begin", "Compute", "Look at results", "More"


def run_options(*without: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the :class:`RunOptions`, but for some, behind its argument, for its parameter `options`."""
    given = [option for name, option in inspect.signature(RunOptions).parameters.items() if name not in without]

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def called(**values: Any) -> None:
            command(options=RunOptions(**{option.name: values.pop(option.name) for option in given}), **values)

        signature = inspect.signature(command)
        argument, *own = [parameter for name, parameter in signature.parameters.items() if name != "options"]
        called.__dict__["__signature__"] = signature.replace(parameters=[argument, *given, *own])
        return called

    return decorated


def of_plugins(field: str) -> dict[str, str]:
    """What plug-ins add to a registry; nothing where one of them cannot be used, which the program says elsewhere."""
    try:
        return offers(field)
    except PluginError:
        return {}


def _with_options(command: Callable[..., None], parameter: str, given: dict[str, Any]) -> Callable[..., None]:
    """A command with further options, name -> annotation; `parameter` of the command has those that are given."""

    @functools.wraps(command)
    def called(**values: Any) -> None:
        chosen = {name: value for name in given if (value := values.pop(name)) not in (None, False)}
        command(**values, **{parameter: chosen})

    signature = inspect.signature(command)
    own = [one for name, one in signature.parameters.items() if name != parameter]
    kind = inspect.Parameter.KEYWORD_ONLY
    flags = [inspect.Parameter(name, kind, default=None, annotation=hint) for name, hint in given.items()]
    called.__dict__["__signature__"] = signature.replace(parameters=[*own, *flags])
    return called


def template_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command an option for each template of a plug-in, for its parameter `templates`, those that are wanted."""
    words = of_plugins("templates")
    help_of = {word: typer.Option(f"--{word}", help=f"For a {word} of your own.") for word in words}
    return _with_options(command, "templates", {word: Annotated[bool, help_of[word]] for word in words})


def figure_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command an option for each key of ``figure``, for its parameter `chosen`: those that are given."""
    options: dict[str, Any] = {}
    for name, key in FIGURE_KEYS.items():
        flag = f"--{name.replace('_', '-')}"
        options[name] = Annotated[str | None, typer.Option(flag, help=key.text)]
        if key.can_be_off:
            options[f"no_{name}"] = Annotated[bool, typer.Option(f"--no-{name}", help=f"Without a {name}.")]

    @functools.wraps(command)
    def called(given: dict[str, Any], **values: Any) -> None:
        off = {name: False for name in FIGURE_KEYS if f"no_{name}" in given}
        command(chosen={name: value for name, value in given.items() if name in FIGURE_KEYS} | off, **values)

    signature = inspect.signature(command)
    own = [one.replace(name="given") if one.name == "chosen" else one for one in signature.parameters.values()]
    called.__dict__["__signature__"] = signature.replace(parameters=own)
    return _with_options(called, "given", options)


#: (experiment, folder of results, whether from scratch, who is told, limits) -> its results, None if not yet complete.
Compute = Callable[["Experiment", Path, bool, "Watch", "Limits"], Path | None]


class Way(NamedTuple):
    """A way to compute experiments, by the value of an option of `spi run`."""

    option: Any  #: its annotation
    start: Callable[[Any], AbstractContextManager[Compute]]


def way_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the ways of plug-ins, for its parameter `ways`: the values of those that are asked for."""
    options = {name: imported(place).option for name, place in of_plugins("ways").items()}
    return _with_options(command, "ways", options)


def load(specs: list[Path], options: RunOptions) -> list["Experiment"]:
    """All experiments, before anything runs.

    Raises SpecError with the mistakes of all of them; StorageError if results cannot be read, or may not be run.
    """
    from ..running.load import load_any, means_another
    from ..specs import SpecError

    overrides = options.assignments
    experiments: list[Experiment] = []
    problems: list[str] = []
    for path in specs:
        try:
            experiments.append(load_any(path, options.profile, overrides, trust_code=options.trust_code))
            if not (options.profile or overrides) and means_another(path, experiments[-1]):
                tell(f"spi: {path}: its spec means something else to this version of spi, so numbers will differ")
        except SpecError as error:
            problems += error.messages
    if problems:
        raise SpecError(*problems)
    return experiments


def found(sources: Sequence[Path] | None, folder: Path, options: RunOptions) -> list["Found"]:
    """Results that a person means: files, spec files, or names of experiments; without any, all.

    Those of names lie in `folder`, and the options of their runs choose among them.  Raises StorageError if there are
    none, or if those of a spec file are of another.
    """
    from ..running import finding

    wanted = finding.Wanted(options.profile or "laptop", tuple(options.assignments))
    if sources:
        return [finding.found(source, folder, wanted) for source in sources]
    return [finding.Found(path) for path in finding.every(folder, wanted)]


def stored(sources: Sequence[Path] | None, folder: Path, options: RunOptions) -> list[Path]:
    """Files of the results that :func:`found` finds."""
    return [one.path for one in found(sources, folder, options)]


def end(code: int, message: str) -> NoReturn:
    """End a command with a line; where a stop is asked for, as such, since errors may only come of it."""
    STOP.check()
    tell(f"spi: {message}")
    raise typer.Exit(code)
