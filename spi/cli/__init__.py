"""Command line: arguments and messages only."""

import os
import signal
import sys
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from ..plugins import PluginError, Registry, lacking
from . import running, showing, starting
from .options import (
    BEGIN,
    COMPUTE,
    DONE,
    FAILED,
    INVALID,
    LOOK,
    MORE,
    STOPPED,
    Command,
    RunOptions,
    Specs,
    load,
    run_options,
)
from .terminal import STOP, drop_unwritable_output, takes_all_characters, tell, write_what_the_terminal_can


class Commands(TyperGroup):
    """Commands by what they are for, each with its whole first sentence."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first argument names; an error says which plug-in has one that is not here."""
        if args[0] not in self.commands and (advice := lacking("commands", args[0])):
            ctx.fail(f"No such command '{args[0]}'; {advice}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each panel."""
        commands: Any = self.commands
        for panel in dict.fromkeys(command.rich_help_panel for command in commands.values()):
            first = {name: of.help.partition("\n\n")[0] for name, of in commands.items() if of.rich_help_panel == panel}
            with formatter.section(panel):
                formatter.write_dl([(name, " ".join(text.split())) for name, text in first.items()])


app = typer.Typer(
    cls=Commands,
    help="A laboratory for stochastic Poisson integrators.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from .. import __version__

        typer.echo(f"spi {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", "-V", "-v", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """A laboratory for stochastic Poisson integrators."""


@run_options()
def check(specs: Specs, options: RunOptions) -> None:
    """Validate experiments and estimate their cost."""
    experiments = load(specs, options)
    from ..printing import cost_line, print_safely
    from ..running.remarks import remarks, reports
    from ..running.run import cost, to_compile

    for experiment in experiments:
        print_safely([cost_line(experiment, cost(experiment), to_compile(experiment))])
        print_safely(f"{experiment.called}: {line}" for line in remarks(experiment))
        for name, lines in reports(experiment).items():
            print_safely([f"{name}:", *(f"  {line}" for line in lines)])


@run_options("samples", "seed")
def model(specs: Specs, options: RunOptions) -> None:
    """Print the Python source of the models of experiments."""
    from ..running.load import sources

    for experiment in load(specs, options):
        for text in sources(experiment):
            typer.echo(text.rstrip("\n"))


def schema() -> None:
    """Print the JSON Schema of experiment files, for editors."""
    import json

    from ..running.load import layers

    typer.echo(json.dumps(layers().json_schema(), indent=2, ensure_ascii=not takes_all_characters()))


_RUN = "spi run rigid_body_strong --profile quick", "spi run my_body.yaml --samples 10^6 --set 'steps=2^-3 .. 2^-8'"
_PLOT = (
    "spi plot rigid_body_strong --profile quick",
    "spi plot results/my_body.h5 --style paper --width two --out figures",
)
#: The commands of the core; a plug-in names its own, each a ``Command``.
_COMMANDS = {
    "list": Command(showing.list_, BEGIN),
    "new": Command(starting.new, BEGIN),
    "doctor": Command(starting.doctor, BEGIN),
    "check": Command(check, COMPUTE),
    "run": Command(running.run, COMPUTE, _RUN),
    "show": Command(showing.show, LOOK),
    "plot": Command(showing.plot, LOOK, _PLOT),
    "trace": Command(running.trace, LOOK),
    "model": Command(model, MORE),
    "schema": Command(schema, MORE),
    "cache": Command(starting.cache, MORE),
}


def _add_commands() -> str | None:
    """Make the commands of the core and of plug-ins those of `spi`; returns why a plug-in cannot be used."""
    problem, whole = None, Registry("commands", _COMMANDS)
    try:
        commands = {name: whole[name] for name in whole}
    except PluginError as error:
        problem, commands = str(error), _COMMANDS
    panels = [BEGIN, COMPUTE, LOOK, MORE]
    for name, command in sorted(commands.items(), key=lambda pair: panels.index(pair[1].panel)):
        command.add_to(app, name)
    return problem


_PLUGIN_PROBLEM = _add_commands()


def main() -> NoReturn:
    """Entry point: turns the errors that a person can make into one line and an exit code."""
    STOP.listen()
    write_what_the_terminal_can()
    arguments = sys.argv[1:]
    if arguments[:1] == ["help"]:  # `spi help run` means `spi run --help`
        arguments = [*arguments[1:], "--help"]
    try:
        threads = os.environ.get("NUMBA_NUM_THREADS", "1")
        if _PLUGIN_PROBLEM:
            tell(f"spi: {_PLUGIN_PROBLEM}")
            code = INVALID
        elif threads.isdecimal() and int(threads) > 0:
            code = _run(arguments)
        else:  # Numba, which reads it when it is imported, would say so with a traceback
            tell(f"spi: the environment has NUMBA_NUM_THREADS={threads}; must be a whole number from 1 on, or unset")
            code = INVALID
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    if code == 128 + signal.SIGINT:
        STOP.ignore()
        tell("spi: stopped")
        code = STOPPED
    drop_unwritable_output()
    sys.exit(code or DONE)


def _run(arguments: list[str]) -> int:
    """Run a command; its exit code, after a line on what went wrong."""
    try:
        code: int = app(arguments, standalone_mode=False, prog_name="spi")
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever reads the output has seen enough
        return FAILED
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # not only Exception: a stop within Rust may become a panic
        code_of_error = _code(error)
        if code_of_error != STOPPED:  # libraries may turn a stop into any other error
            STOP.check()
        if code_of_error is None:
            raise
        message = _usage(error) if isinstance(error, typer.TyperException) else str(error)
        tell(message if message.startswith("Usage") else "\n".join(f"spi: {line}" for line in message.split("\n")))
        return code_of_error


def _usage(error: typer.TyperException) -> str:
    """Mistake in a command line; where an argument is missing, also its help."""
    message = error.format_message().replace("Value error, ", "")  # how pydantic begins what typer says
    option = getattr(error, "option_name", "").lstrip("-")
    if advice := lacking("ways", option) or lacking("templates", option):
        return f"No such option: --{option}; {advice}"
    argument, context = (getattr(error, name, None) for name in ("param", "ctx"))
    if not (argument and context and message.startswith("Missing argument")):
        return message
    right = argument.help.rstrip(".")
    return f"{message.rstrip('.')}: {right[0].lower()}{right[1:]}; see `{context.command_path} --help`"


def _code(error: BaseException) -> int | None:
    """Exit code of an error that has a message for people, or None."""
    if isinstance(error, typer.TyperException):
        return error.exit_code
    from ..checks.compilable import CompilationError
    from ..running.checkpoint import Stopped
    from ..running.workers import WorkersLost
    from ..specs import SpecError
    from ..storage import StorageError

    if isinstance(error, Stopped):
        return STOPPED
    if isinstance(error, SpecError | StorageError):
        return INVALID
    return FAILED if isinstance(error, OSError | CompilationError | WorkersLost) else None
