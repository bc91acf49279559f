"""Functions of arrays: those of `trpac_core/robust/arrays.py`, and numpy's."""

from __future__ import annotations

import ast

from .expressions import Expressions
from .loops import RELATION, SUM, TERNARY, Expression, element
from .types import DOUBLE, INT, array_of

HELPERS = {
    "greatest": """\
static double greatest(const double *values, int n)
{
    double most = values[0];
    bool odd = most != most;
    for (int j = 1; j < n; j++) {
        most = values[j] > most ? values[j] : most;
        odd |= values[j] != values[j];
    }
    return odd ? NAN : most;
}""",
    "first_greatest": """\
static int first_greatest(const double *values, int n)
{
    int most = 0;
    for (int j = 1; j < n && values[most] == values[most]; j++)
        if (!(values[j] <= values[most]))
            most = j;
    return most;
}""",
    "cumulated": """\
static void cumulated(double *result, const double *values, int n)
{
    result[0] = values[0];
    for (int j = 1; j < n; j++)
        result[j] = result[j - 1] + values[j];
}""",
    "spacing": """\
static void spacing(double *result, const double *values, int n)
{
    result[0] = values[1] - values[0];
    for (int j = 1; j < n - 1; j++)
        result[j] = (values[j + 1] - values[j - 1]) / 2.0;
    result[n - 1] = values[n - 1] - values[n - 2];
}""",
    "count_below": """\
static int count_below(const double *ascending, double value, int n)
{
    int low = 0, high = n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (before(ascending[middle], value))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}""",
    "count_up_to": """\
static int count_up_to(const double *ascending, double value, int n)
{
    int low = 0, high = n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (!before(value, ascending[middle]))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}""",
}
"""The functions of `trpac_core/robust/arrays.py` that are no loop of their own."""
MAKES_ARRAY = frozenset(("cumulated", "spacing"))
"""Those of them that write an array."""
COUNTS = frozenset(("first_greatest", "count_below", "count_up_to"))
"""Those of them that return a whole number."""
ELEMENTWISE = {
    "exp": "exp({})",
    "log": "log({})",
    "np.sqrt": "sqrt({})",
    "np.absolute": "fabs({})",
    "np.minimum": "minimum({}, {})",
    "np.maximum": "maximum({}, {})",
}
"""Functions of every element."""
APART = ("exp", "log")
"""Those of the C library: a loop without them works out two numbers at once."""
ARRAY_FUNCTIONS = frozenset((*HELPERS, *ELEMENTWISE, "np.where", "np.zeros", "total", "over_rows"))
"""All that is not translated but known."""


class Arrays(Expressions):
    """Calls of the functions of arrays."""

    def array_call(self, name: str, node: ast.Call) -> Expression:
        """A call of one of the functions of arrays."""
        wanted, self.wanted = self.wanted, ""
        if name == "np.zeros":
            given = node.args[0]
            sizes = given.elts if isinstance(given, ast.Tuple) else [given]
            shape = tuple(int(self.expr(size).text) for size in sizes)
            return Expression("", array_of(DOUBLE, shape), at=lambda _: Expression("0.0", DOUBLE))
        parts = [self.plain(self.expr(value, DOUBLE)) for value in node.args]
        self.wanted = wanted
        if name == "np.where":
            binds = (RELATION, TERNARY + 1, TERNARY)
            return self.each("{} ? {} : {}", parts, binds, DOUBLE, TERNARY)
        if name in ELEMENTWISE:
            made = self.each(ELEMENTWISE[name], parts, [0] * len(parts), DOUBLE)
            return self.apart(made) if name in APART and made.at is not None else made
        if name == "over_rows":
            return self._over_rows(parts[0])
        if name == "total":
            kind = array_of(DOUBLE, (*parts[0].type.shape[:-1], 1))
            return self.worked_out(kind, parts[0], sums=True)
        return self._helper(name, parts)

    def _over_rows(self, e: Expression) -> Expression:
        """The sum over the first axis."""
        self.ready(e)
        rows = range(e.type.shape[0])

        def at(indices: tuple[str, ...]) -> Expression:
            terms = [element(e, (str(i), *indices)).bound(SUM + 1) for i in rows]
            return Expression(" + ".join(terms), DOUBLE, SUM)

        return Expression("", array_of(DOUBLE, e.type.shape[1:]), at=at, names=e.names)

    def _helper(self, name: str, parts: list[Expression]) -> Expression:
        """A call of a function that takes an array as a whole."""
        self.program.helpers.setdefault(name, HELPERS[name])
        address, kind = self.placed(parts[0]), parts[0].type
        given = ", ".join([address, *(part.text for part in parts[1:]), str(kind.size)])
        if name not in MAKES_ARRAY:
            return Expression(f"{name}({given})", INT if name in COUNTS else DOUBLE)
        result = self.local_array(self.array_name(), kind)
        self.put(f"{name}({result.address}, {given});")
        return result

    def placed(self, e: Expression) -> str:
        """The address of an array that is worked out."""
        if not e.address:
            raise self.refuse("an array that has no name yet, as a whole: give it one before.")
        for name in e.names:
            self.store(name)
        self.ready(e)
        return e.address
