"""Writes the pages of ``docs/reference`` from the code: ``python docs/generate/reference.py [FOLDER]``.

What stands there is asked of the program itself: the command line, the JSON Schema of spec files, the models, the
schemes and the experiments that come with it.

Short form: pages
"""

import inspect
import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_type_hints

import stored
import typer
import yaml
from formulas import FORMULAS
from words import Rows, default_of, in_symbols, key_rows, key_table, linked, paragraphs, plain, table, value_of

import spi
from spi.cli import app, options
from spi.ensemble.protocol import large
from spi.kinds import KINDS
from spi.models import MODELS
from spi.printing.text import fraction
from spi.running import shipped
from spi.running.load import layers
from spi.schemes import SCHEMES
from spi.specs.keys import text_in

FOLDER = Path(__file__).parents[1] / "reference"
NOTE = "<!-- Written by docs/generate/reference.py; `make docs` writes it again. -->\n\n"

EXIT_CODES = {
    options.DONE: "done",
    options.FAILED: "failed",
    options.INVALID: "wrong usage, or an invalid spec",
    options.STOPPED: "stopped; run the same command again to resume",
    options.CLAIM_FAILED: (
        "done, but a claim is contradicted, or not confirmed with `--confirmed`, or recomputed results differ"
    ),
}
#: What a bare number under ``expect`` means.
SENSES = {"equal": "this number", "at most": "at most this number", "at least": "at least this number"}
#: What typer calls the values of options -> what they are.
VALUES = {"<str>": "TEXT", "<path>": "PATH", "<int range>": "N"}


# ---------------------------------------------------------------------------------------------------------------------
# The pages
# ---------------------------------------------------------------------------------------------------------------------


def commands() -> str:
    """The command line."""
    group: Any = typer.main.get_command(app)
    text = "# The command line\n\n"
    text += "Data goes to standard output, progress and messages go to standard error.\n\n"
    context = group.make_context("spi", [], resilient_parsing=True)
    each = {name: group.get_command(context, name) for name in group.list_commands(context)}
    first = {name: command.help.partition("\n\n")[0] for name, command in each.items()}
    text += table(("command", "does"), ((f"[`spi {name}`](#spi-{name})", plain(does)) for name, does in first.items()))
    for name, command in each.items():
        inner = command.make_context(name, [], parent=context, resilient_parsing=True)
        text += f"\n## spi {name}\n\n{plain(command.help)}\n\n"
        records = filter(None, (parameter.get_help_record(inner) for parameter in command.get_params(inner)))
        text += table(("argument or option", "what it does"), ((_option(what), plain(said)) for what, said in records))
    text += "\n## Exit codes\n\n" + table(("code", "meaning"), EXIT_CODES.items())
    text += (
        "\nCtrl-C and SIGTERM stop a run with exit code 3, from the moment that the program has started. Once the\n"
        "results of the last experiment are written they change nothing, and the code is 0.\n"
    )
    return text


def _option(text: str) -> str:
    """How an option or an argument is written; its name says what an argument is."""
    for name, value in VALUES.items():
        text = text.replace(name, value)
    text = text if text.startswith("-") else text.partition(" ")[0]
    return f"`{text.replace('|', ' or ')}`"


def spec_keys() -> str:
    """The keys of spec files, for each kind of experiment."""
    schema = layers().json_schema()
    definitions = schema["$defs"]
    each = {
        kind: key_rows(definitions[kind], module.keys.Case.model_json_schema(), definitions)
        for kind, module in KINDS.items()
    }
    shared = {
        key: row
        for key, row in each["strong"].items()
        if key != "kind" and all(rows.get(key) == row for rows in each.values())
    }
    text = SPEC_PAGE.format(keys=key_table(shared), kinds=", ".join(f"[`{kind}`](#{kind})" for kind in KINDS))
    for kind, module in KINDS.items():
        own = {key: row for key, row in each[kind].items() if key not in (*shared, "kind")}
        text += f"\n## {kind}\n\n{plain(module.keys.Case.__doc__ or '')}\n\n{key_table(own)}"
        text += _claimable(module.keys.Case.quantities)
        names = ", ".join(f"`{name}`" for name, keys in experiments_known().items() if keys["kind"] == kind)
        text += f"\nExperiments: {names}.\n" if names else ""
    from spi.plugins.systems.keys import KEYS as SYSTEM_KEYS  # no page is written where a plug-in is left out

    text += "\n## A system under `model`\n\nSee [systems in YAML](../own_systems.md).\n\n"
    text += table(("key", "what it is"), ((f"`{key}`", plain(said)) for key, said in SYSTEM_KEYS.items()))
    text += "\n## A file under `initial`\n\n"
    part = definitions["FromFile"]
    text += f"{plain(part['description'])}\n\n{key_table(key_rows(part, part, definitions))}\n"
    text += "\n## A vorticity under `initial`\n\nOf `sine_euler` and `zeitlin`; see [fluids](../fluids.md).\n\n"
    for name in ("Vorticity", "Random"):
        part = definitions[name]
        text += f"{plain(part['description'])}\n\n{key_table(key_rows(part, part, definitions))}\n"
    return text


SPEC_PAGE = """# The keys of a spec file

A spec file is one mapping in YAML. `kind` is one of {kinds};
it decides which other keys there are. Numbers may be arithmetic (`2/3`, `cos(1.1)`, `2^-16`, `10^5`). An unknown key is
an error that names the line and the nearest known key. `spi check SPEC` says whether a file is valid; `spi schema`
prints the same as JSON Schema, for editors.

Units: *time* is the unit of t in the equation, *state* that of the components of y, *value* that of a test function,
and *seconds* are those of a clock. Where no unit is given the number has none.

Later layers override earlier ones key by key, and a model parameter by parameter: the file, then a case of `cases`,
then the profile, then `cases` of the profile, then `--set`. Other mappings are replaced whole, but `--set a.b=...`
changes one entry and leaves the others of `a`, as `--set initial.sweeps=8000` does, except in `functions` and
`compositions`. A case is a mapping with a `name` of its own, perhaps a `title`, and any keys of the kind. The file
itself is the profile `laptop`.

## Keys of every kind

{keys}"""


def _claimable(quantities: Mapping[str, Any]) -> str:
    rows = [(f"`{name}`", SENSES[claim.sense], "yes" if claim.per_step else "no") for name, claim in quantities.items()]
    if not rows:
        return ""
    head = ("quantity", "a bare number means", "for each step size, with `up to`")
    return f"\nWhat may stand under `expect` (see [claims](../claims.md)):\n\n{table(head, rows)}"


def models() -> str:
    """The models with their equations and parameters."""
    definitions = layers().json_schema()["$defs"]
    text, told, classes = MODELS_PAGE, set(), dict[str, Any](MODELS)
    for name, cls in classes.items():
        module = sys.modules[cls.__module__]
        about = [cls.__doc__] if module in told else [module.__doc__, cls.__doc__]
        told.add(module)
        text += "\n\n".join((f"\n## {name}", *(in_symbols(plain(paragraphs or "")) for paragraphs in about))) + "\n\n"
        if not large(cls):
            text += f"Number of components: {cls.dimension}, pieces of H: {cls.pieces}, noises: {cls.noises}, "
            text += f"Casimir functions: {cls.conserved}.\n\n"
        text += table(("parameter", "value", "default", "what it is"), _parameters(cls, definitions))
    noise = definitions["ModeNoise"]
    described = in_symbols(plain(noise["description"]))
    return f"{text}\n### noise of zeitlin\n\n{described}\n\n{key_table(key_rows(noise, noise, definitions))}"


MODELS_PAGE = r"""# Models

Every model is a stochastic Poisson system in Stratonovich form,

```math
\mathrm{d}y = B(y) \nabla H(y)\,\mathrm{d}t + \sum_k \sigma_k B(y) \nabla \widehat H_k(y) \circ \mathrm{d}W_k(t),
\qquad H = H_1 + \cdots + H_p,
```

with independent Wiener processes W₁, ..., Wₘ. B is the structure matrix, and C are Casimir functions, B(y) ∇C(y) = 0.
The parameters are the keys under `model` next to `name`, as in
`model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}`. They are pure numbers. Any model may have
linear [damping](../damping.md); custom systems are written [in YAML](../own_systems.md) or
[in Python](../own_models.md).
"""


def _parameters(cls: Any, definitions: Mapping[str, Any]) -> Rows:
    properties = definitions[f"{cls.__name__}Part"]["properties"]
    for key, hint in get_type_hints(cls, include_extras=True).items():
        default = "**required**" if key not in cls._field_defaults else default_of(cls._field_defaults[key])
        yield f"`{key}`", value_of(properties[key], definitions), default, plain(text_in(hint) or "")


def schemes() -> str:
    """The schemes with their formulas and orders."""
    head = ("scheme", "strong order", "with one noise", "weak order", "preserves")
    orders = {name: (r.strong_order, r.strong_order_commuting, r.weak_order) for name, r in SCHEMES.items()}
    rows = ((f"[`{n}`](#{n})", *map(fraction, orders[n]), row.preserves) for n, row in SCHEMES.items())
    text = SCHEMES_PAGE + table(head, rows)
    for name, row in SCHEMES.items():
        text += f"\n## {name}\n\nIn tables and figures it is called *{row.label}*.\n\n{_formula(name, row)}\n\n"
        text += f"Source: {linked(row.reference)}.{_conditions(row)}\n"
    return text


def _formula(name: str, row: Any) -> str:
    """The formula of a scheme as a block: in LaTeX where there is one, otherwise in plain text."""
    if name in FORMULAS:
        lines = "\\\\\n".join(line.strip() for line in FORMULAS[name].split(r"\\"))
        return f"```math\n{lines}\n```"
    return f"```text\n{textwrap.fill(in_symbols(row.formula), 100, subsequent_indent='    ')}\n```"


def _conditions(row: Any) -> str:
    """What a scheme asks of a spec."""
    asks = {
        "Needs `truncate_noise: true`.": row.needs_truncation,
        "For the [multiscale system](../multiscale.md): needs `eps`.": row.multiscale,
        "`eps` must not be 0.": row.needs_eps,
        f"Of the built-in models for {_able(row)}.": row.needs is not None and bool(_able(row)),
        "Also for the model `zeitlin`.": row.for_large_models,
        "Its expectations can be computed without sampling.": row.solvable_without_sampling,
    }
    return "".join(f" {sentence}" for sentence, holds in asks.items() if holds)


def _able(row: Any) -> str:
    return ", ".join(f"`{name}`" for name, cls in MODELS.items() if row.needs and row.needs(cls))


SCHEMES_PAGE = """# Schemes

A step of size h leads from y to z. Y_H is the vector field B ∇H, and exp(t Y_H) y its exact flow; f = B ∇H,
fₖ = B ∇Ĥₖ, and dWₖ is the increment of Wₖ over the step. *Strong order* holds with several noises that do not
commute, *with one noise* also with several that commute. Custom compositions of flows need no program: see
[compositions](../compositions.md). Equations and remarks have the numbers of the paper,
[arXiv:2111.07387](https://arxiv.org/abs/2111.07387).

"""


def experiments_known() -> dict[str, dict[str, Any]]:
    """name -> the keys of the experiments that come with the program, as they stand in their files."""
    return {name: yaml.safe_load(shipped.path_of(name).read_text(encoding="utf-8")) for name in shipped.names()}


def experiments() -> str:
    """The experiments that come with the program."""
    text = (
        "# Experiments\n\nThey come with the program: `spi run NAME` runs one in any folder, `spi plot NAME` draws it. "
    )
    text += "*Figure* is that of the paper, [arXiv:2111.07387](https://arxiv.org/abs/2111.07387).\n\n"
    rows = (
        (
            f"`{name}`",
            keys["figure"] if isinstance(keys.get("figure"), int) else "",
            f"[{keys['kind']}](spec.md#{keys['kind']})",
            keys["title"],
            plain(keys["asks"]),
        )
        for name, keys in experiments_known().items()
    )
    return text + table(("name", "figure", "kind", "title", "what it asks"), rows)


def python() -> str:
    """What ``import spi`` offers."""
    offered = {name: getattr(spi, name) for name in spi.__all__ if name != "__version__"}
    text = f"# Python\n\n```python\nimport spi\n```\n\n{paragraphs(spi.__doc__)}\n"
    for name, thing in offered.items():
        text += f"\n## spi.{name}\n\n"
        if inspect.isfunction(thing):
            text += f"```text\n{_call(name, thing)}\n```\n\n"
        text += f"{paragraphs(thing.__doc__)}\n"
        if thing is spi.Results:
            members = ((member, inspect.getdoc(getattr(thing, member)) or "") for member in vars(thing))
            rows = ((f"`{member}`", plain(said.partition("\n\n")[0])) for member, said in members if member[0] != "_")
            text += "\n" + table(("attribute or method", "what it is"), rows)
    return text


def _call(name: str, function: Any) -> str:
    """How a function is called: its parameters and their defaults, a line if they fit into one."""
    given = [str(one.replace(annotation=one.empty)) for one in inspect.signature(function).parameters.values()]
    keywords = [one.kind is one.KEYWORD_ONLY for one in inspect.signature(function).parameters.values()]
    if any(keywords):
        given.insert(keywords.index(True), "*")
    return textwrap.fill(f"spi.{name}({', '.join(given)})", 100, subsequent_indent=" " * len(f"spi.{name}("))


PAGES = {
    "commands": commands,
    "spec": spec_keys,
    "models": models,
    "schemes": schemes,
    "experiments": experiments,
    "results": stored.page,
    "python": python,
}


def pages() -> dict[Path, str]:
    """All pages: file -> text."""
    return {FOLDER / f"{name}.md": NOTE + write() for name, write in PAGES.items()}


if __name__ == "__main__":
    written = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    written.mkdir(exist_ok=True)
    for path, text in pages().items():
        (written / path.name).write_text(text, encoding="utf-8")
