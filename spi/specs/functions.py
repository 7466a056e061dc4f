"""The key ``functions`` of test functions, which several kinds of experiment have."""

from typing import TYPE_CHECKING, Any, Self

import pydantic

from ..ensemble.protocol import dimension
from ..expressions import canonical, is_constant, parse_expression
from ..expressions.arithmetic import NumberError
from ..systems.keys import MOST
from .keys import Functions, Keys, condition, key_of, shown, wrong
from .mistakes import every


class FunctionKeys(Keys):
    """The test functions of a case."""

    functions: key_of(Functions, "test functions, as in {phi: sin(2*pi*y1) + y2^2}, or the text of one named phi") = (
        pydantic.Field(default_factory=dict)
    )

    if TYPE_CHECKING:  # what every case has
        model: Any
        variables: tuple[str, ...]

    @property
    def expressions(self) -> tuple:
        """The trees of the test functions, in the order of their names."""
        return tuple(parse_expression(text, dimension(self.model)) for text in self.functions.values())

    @pydantic.field_serializer("functions")
    def _canonical(self, functions: dict[str, str]) -> Any:
        # pairs, because their order decides that of the results, and in the least text that decides the values
        return [[name, canonical(e)] for name, e in zip(functions, self.expressions, strict=True)]

    @condition("functions", "model")
    def _check_functions(self) -> Self:
        trees = every(self._tree, self.functions.items())
        if not self.variables:
            return self
        texts = dict(zip(self.functions, map(canonical, trees), strict=True))
        return self.model_copy(update={"functions": texts})

    def _tree(self, name: str, text: str) -> Any:
        """The tree of a test function."""
        try:
            tree = parse_expression(text, d := dimension(self.model), self.variables)
            if is_constant(tree):
                raise NumberError("constant")
        except NumberError as error:
            known = ", ".join(self.variables) or f"y1 .. y{min(d, MOST)}"
            example = f"{self.variables[0]}^2" if self.variables else "sin(2*pi*y1) + y2^2"
            right = f"must be an expression in {known} such as {example}"
            raise wrong(f"is {shown(text)} ({error})", right, "functions", name) from None
        return tree
