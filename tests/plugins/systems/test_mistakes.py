"""Mistakes in definitions, formulas and names of algebras, from mistakes.yaml: their place and words of the message."""

from pathlib import Path

import pytest
import yaml
from test_yaml_brackets import constants
from test_yaml_texts import WORDS

from spi.expressions.arithmetic import NumberError
from spi.plugins.systems.definition import define, strengths
from spi.plugins.systems.keys import DefinitionError
from spi.plugins.systems.text import addends, expression

TABLES = yaml.safe_load(Path(__file__).with_name("mistakes.yaml").read_text(encoding="utf-8"))
DEFINITIONS = {name: table for name, table in TABLES.items() if name not in ("formulas", "algebras")}


@pytest.mark.parametrize("name", DEFINITIONS)
def test_errors_of_a_definition_name_the_key_and_the_remedy(name):
    good = DEFINITIONS[name]["good"]
    define(good)
    strengths(good, None)
    for changes, place, words in DEFINITIONS[name]["mistakes"]:
        data = {key: value for key, value in {**good, **changes}.items() if value is not None}
        with pytest.raises(DefinitionError) as error:
            define({key: value for key, value in data.items() if key != "sigma"})
            strengths(good, data.get("sigma"))
        assert "/".join(map(str, error.value.keys)) == place and words in str(error.value), changes
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"), [*TABLES["formulas"], ("(" * 2000, ""), ("p" * 30_000, "longer than 20000")]
)
def test_wrong_formulas(text, words):
    for read in (expression, addends):
        with pytest.raises(NumberError) as error:
            read(text, WORDS)
        assert words in str(error.value)


@pytest.mark.parametrize(("name", "words"), TABLES["algebras"])
def test_what_is_no_algebra(name, words):
    with pytest.raises(NumberError) as error:
        constants(name)
    assert words in str(error.value)
