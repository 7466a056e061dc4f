"""Test functions of texts."""

from spi.expressions import as_numpy, parse_expression


def functions_of(texts, dimension):
    """The functions phi(y) of arrays of states of each of some texts."""
    return [as_numpy(parse_expression(text, dimension)) for text in texts]
