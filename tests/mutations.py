"""Spec files made from the experiments by random changes, and whether ``spi check`` takes or refuses them in one line.

    python tests/mutations.py 10000

checks that many and says what came of them; ``test_mutations.py`` does the same with few.
"""

import os
import random
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path

import yaml
from damage import call

#: Those of systems in files of their own are left out, as each is checked in an empty folder.
EXPERIMENTS = [
    path
    for path in sorted((Path(__file__).parents[1] / "experiments").glob("*.yaml"))
    if not re.search("(system|python):", path.read_text(encoding="utf-8"))  # which name files of their own
]
TEXTS = [path.read_text(encoding="utf-8") for path in EXPERIMENTS]

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


def mutated(draw, text):
    """(what was done, whether it is certainly wrong, the text) of one random change to the document."""
    if draw.random() < 0.25:
        return changed_text(draw, text)
    data = yaml.load(text, yaml.BaseLoader)
    place = draw.choice(list(places(data)))
    owner = data
    for step in place[:-1]:
        owner = owner[step]
    what, key = draw.choice(("value", "value", "value", "key", "drop", "nest", "copy")), place[-1]
    if what == "value":
        owner[key] = draw.choice(VALUES)
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


def answer(draw, folder):
    """(what was done, exit code, whether that is as it should be, stderr, text) of one changed experiment."""
    number = draw.randrange(len(TEXTS))
    what, certain, text = mutated(draw, TEXTS[number])
    file = folder / EXPERIMENTS[number].name
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    code, out, err = call("check", file)
    if code == 0:
        first, *more = out.splitlines() or [""]  # under the line of the cost stands what was found of the model
        right = not certain and first.startswith(f"{file}: valid") and not err and not FOREIGN.search("".join(more))
    else:
        lines = err.splitlines()  # one for each mistake
        right = code == 2 and not out and len({*lines}) == len(lines) > 0
        right = right and all(line.startswith(f"spi: {file}:") for line in lines)
    right = right and not FOREIGN.search(err.replace(f"spi: {file}", "")) and os.listdir(folder) == [file.name]
    file.unlink()
    return what, code, right, err, text


def main(count):
    draw, found, wrong = random.Random(1), Counter(), 0
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(count):
            what, code, right, err, text = answer(draw, Path(folder))
            found[what, code] += 1
            if not right:
                wrong += 1
                print(f"WRONG: {what}, exit code {code}: {err!r}\n{text[:3000]}")
    print(*(f"{what}: exit code {code}: {n}" for (what, code), n in sorted(found.items())), sep="\n")
    print(f"{count} specs, {count - wrong} taken or refused in one line, as they should be")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000))
