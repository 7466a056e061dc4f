"""Spec files made from the experiments by random changes, and whether ``spi check`` takes or refuses them in one line:
the means of test_mutations.py.
"""

import contextlib
import copy
import os
import re
import signal
import traceback
from pathlib import Path

import left_out
import yaml
from damage import call
from reuse_cases import FILES, SPECS

from spi.kinds import KINDS

EXPERIMENTS = sorted((Path(__file__).parents[1] / "experiments").glob("*.yaml"))
#: Specs with many keys, of all kinds.
MANY_KEYS = [f"kind: {kind}\n{text}\n" for kind, text in SPECS.items() if kind in KINDS]


def kind_of(text):
    """The kind of a spec."""
    return re.search(r"^kind: (\w+)", text, re.MULTILINE)[1]


#: kind -> (name of the file, text) of all specs of that kind.
TEXTS = {}
for _path in EXPERIMENTS:
    _text = _path.read_text(encoding="utf-8")
    # Systems in files of their own are left out, as each spec is checked in an empty folder.
    if not re.search("(system|python):", _text) and left_out.can_be_read(_text):
        TEXTS.setdefault(kind_of(_text), []).append((_path.name, _text))
for _n, _text in enumerate(MANY_KEYS):
    TEXTS.setdefault(kind_of(_text), []).append((f"many{_n}.yaml", _text))

#: What may stand in the place of a value; most of it is wrong nearly everywhere.
VALUES = (
    *(None, True, "", "x", "sin", "nan", "inf", "-inf", "1e309", "1e-320", "0", "-0.0", "-1", "1/0", "2^-5", "2^99999"),
    *(
        "10^400",
        "1e150",
        "1e-150",
        "1+1i",
        "i",
        "(" * 300,
        "a" * 70_000,
        "σ",
        "\u202e",
        "\ud800",
        "\0",
        "\x1b[2J",
        "y1",
    ),
    *("sin(2*pi*y1)", "exp(1e3*y1)", "1e308*y1*10", "splitting", "2^-3 .. 2^-5", "2^0 .. 2^-60", "2^-5 .. 3", ".."),
    *([], {}, [[]], [None], ["1"] * 3, ["1e200"] * 3, ["0"] * 3, ["1"] * 5000, {"a": {"b": ["c"]}}, {"": ""}),
    *({"name": "rigid_body"}, {"name": []}, {"<<": "1"}, "!!binary aGk=", "2023-01-01", "0x10", "1_000", "~", "yes"),
)
LONGEST = 30  #: seconds of the processor that a check may take
#: Wording of the libraries below, which nobody who writes a spec should have to read.
FOREIGN = re.compile(
    r"Value error|Input should|pydantic|validation error|Traceback|<class|Extra inputs|Field required|\.py\b"
)


def places(data, here=()):
    """The places of all values in a document: keys and numbers of entries."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in inner:
        yield (*here, key)
        yield from places(value, (*here, key))


def value_at(data, place):
    """What stands at a place."""
    for step in place:
        data = data[step]
    return data


def mutated(draw, text):
    """(what was done, whether it is certainly wrong, the text) of one random change to the document."""
    if draw.random() < 0.25:
        return changed_text(draw, text)
    data = yaml.load(text, yaml.BaseLoader)
    place = draw.choice(list(places(data)))
    owner = data
    for step in place[:-1]:
        owner = owner[step]
    ways = ("value", "value", "value", "key", "drop", "nest", "copy", "another", "of another")
    what, key = draw.choice(ways), place[-1]
    if what == "value":
        owner[key] = draw.choice(VALUES)
    elif what in ("another", "of another"):
        other = yaml.load(draw.choice(draw.choice(list(TEXTS.values())))[1], yaml.BaseLoader)
        source = data if what == "another" else other
        owner[key] = copy.deepcopy(value_at(source, draw.choice(list(places(source)))))
    elif what == "key" and isinstance(owner, dict):
        owner[draw.choice((f"{key}x", "", "σ", "\0", "name", "model", key.upper()))] = owner.pop(key)
    elif what == "drop":
        del owner[key]
    elif what == "nest":
        owner[key] = draw.choice(([owner[key]], {key: owner[key]}, [owner[key]] * 3))
    else:
        data[f"{draw.choice(list(data))}2"] = owner[key]
    certain = what in ("copy",) or bad_characters(data)
    return what, certain, yaml.dump(data, allow_unicode=draw.random() < 0.5, sort_keys=False)


def bad_characters(data):
    """Whether a text in the document cannot be stored."""
    if isinstance(data, dict):
        return any(bad_characters(part) for pair in data.items() for part in pair)
    return any(map(bad_characters, data)) if isinstance(data, list) else bool(re.search("[\0\ud800\x1b]", str(data)))


def changed_text(draw, text):
    """The same of a change to the characters."""
    at = draw.randrange(len(text))
    what = draw.choice(("insert", "cut", "delete", "tab", "repeat"))
    odd = draw.choice(
        ("\0", "\t", "{", "[", "]", ":", "&a", "*a", "!!python/object:os.system", "\x85", "%", '"', "'", "é")
    )
    new = {
        "insert": text[:at] + odd + text[at:],
        "cut": text[:at],
        "delete": text[:at] + text[at + draw.randint(1, 40) :],
        "tab": text.replace(" ", "\t", draw.randint(1, 5)),
        "repeat": text + text[at:],
    }[what]
    return what, what == "insert" and odd == "\0", new


def answer(draw, folder, kind=None):
    """(what was done, exit code, whether that is as it should be, stderr, text) of one changed experiment of a kind."""
    kind = draw.choice(list(TEXTS)) if kind is None else kind
    name, text = draw.choice(TEXTS[kind])
    what, certain, text = mutated(draw, text)
    file = folder / name
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    (folder / "known.csv").write_text(FILES["known.csv"][0], encoding="utf-8")
    try:
        with limited(LONGEST):
            code, out, err = call("check", file)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        code, out, err = "traceback", "", traceback.format_exc()
    if code == 0:
        first, *more = out.splitlines() or [""]  # under the line of the cost stands what was found of the model
        right = not certain and first.startswith(f"{file}: valid") and not err and not FOREIGN.search("".join(more))
    else:
        lines = err.splitlines()  # one for each mistake
        right = code == 2 and not out and len({*lines}) == len(lines) > 0
        right = right and all(line.startswith(f"spi: {file}:") for line in lines)
    right = right and not FOREIGN.search(err.replace(f"spi: {file}", ""))
    right = right and sorted(os.listdir(folder)) == sorted([file.name, "known.csv"])
    for made in folder.iterdir():
        made.unlink()
    return what, code, right, err, text


@contextlib.contextmanager
def limited(seconds):
    """TimeoutError where what is within takes more seconds of the processor."""

    def end(*_):
        raise TimeoutError(f"more than {seconds} s of the processor")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
