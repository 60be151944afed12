"""Arithmetic that a user wrote, as a formula: ``200*sin(x/500) + 80*fbm(1500)``.

The text is parsed, never run: what is not in the short list of nodes and names below is refused,
with its place in the text. Numbers are floats, so that ``9**9**9`` is merely too large.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terrakit.errors import ParameterError
from terrakit.formula import functions as f
from terrakit.formula.expression import Formula, Number, apply, as_formula, constant

if TYPE_CHECKING:
    from terrakit.formula.place import Place
    from terrakit.heightfield import Grid, Layer
    from terrakit.parameters import Seed

LONGEST = 4000
"""Characters of one text."""
MOST_NODES = 1000
"""Numbers, names, signs and calls in all texts of one operator."""
DEEPEST = 100
"""Signs and calls inside each other, as in a sum of so many terms."""
MOST_DEFINITIONS_DEEP = 20
MOST_NOISES = 32
LARGEST_WHOLE_POWER = 1000
FLOAT_MAX = 3.4028234e38

CONSTANTS = {"pi": math.pi, "tau": math.tau, "e": math.e}
NAN = constant(math.nan)
INFINITY = constant(math.inf)

Variables = Mapping[str, Callable[[], Formula]]
"""What names stand for; called only for those that occur."""
Definitions = Mapping[str, str | float]


@dataclass(frozen=True)
class NoiseCall:
    """One call of a noise in a text."""

    function: str
    stream: str
    wavelength: float
    octaves: int = 8
    gain: float = 0.5
    basis: str = "gradient"


Noises = Callable[[NoiseCall], Formula]


def formula_at(
    place: Place,
    text: str,
    definitions: Definitions,
    variables: Variables,
    stream: str,
    seed: Seed,
) -> Formula:
    """Return the formula that a text describes.

    Parameters
    ----------
    place
        Where; noise is taken from here.
    text
        The arithmetic.
    definitions
        Further names, each a number or arithmetic of its own.
    variables
        What the names of the place stand for.
    stream
        Name of the operator, for its random numbers.
    seed
        The operator's own seed.
    """

    def noise(call: NoiseCall) -> Formula:
        from terrakit.formula import fractal

        words = place.words(f"{stream} {call.stream}", seed)
        if call.function == "noise":
            return place.noise(call.basis, call.wavelength, words)
        octaves = place.octaves(call.basis, call.wavelength, call.octaves, words, gain=call.gain)
        if call.function == "ridged":
            return fractal.ridged_multifractal(octaves, 1.0, 2.0)
        sums = {
            "fbm": fractal.fbm,
            "billow": fractal.billow,
            "turbulence": fractal.turbulence,
        }
        return sums[call.function](octaves)

    return _Reading(definitions, variables, noise).text("formula", text)


def check_text(text: str, definitions: Definitions, names: tuple[str, ...]) -> None:
    """Raise ParameterError where a text is no arithmetic of these names.

    Parameters
    ----------
    text
        The arithmetic.
    definitions
        Further names, each a number or arithmetic of its own.
    names
        The names of the place; one that ends in ``_`` stands for its family.
    """
    taken = {*CONSTANTS, *FUNCTIONS, *NOISES, *names}
    for name in definitions:
        if not name.isidentifier() or not name.isascii():
            raise ParameterError(
                f"define: {name!r} is no name; use letters, digits and _, a letter first"
            )
        if name in taken:
            raise ParameterError(f"define: {name!r} means something already; use another name")
    stand_in = Formula("column")
    anything = _AnyOf(names, stand_in)
    reading = _Reading(definitions, anything, lambda call: stand_in)
    reading.text("formula", text)
    for name in definitions:
        reading.definition(name)


def refuse_not_finite(grid: Grid, elevation: Layer, text: str) -> None:
    """Raise ParameterError where a computed height is infinite or no number."""
    import numpy as np

    if not elevation.not_finite():
        return
    wrong = ~np.isfinite(elevation.host())
    row, col = (int(i) for i in np.argwhere(wrong)[0])
    west, north = grid.north_west
    x, y = west + col * grid.spacing, north - row * grid.spacing
    raise ParameterError(
        f"formula = {_shown(text)!r}: {int(wrong.sum())} of {wrong.size} heights are not finite, "
        f"first at east {x:g}, north {y:g} m: a division by zero, the root or logarithm of a "
        "negative number, or an overflow; guard it with max(..., 0.001) or `a if test else b`"
    )


class _AnyOf(Mapping[str, Callable[[], Formula]]):
    """Variables of which only the names count."""

    def __init__(self, names: tuple[str, ...], stand_in: Formula) -> None:
        self.names = names
        self.stand_in = stand_in

    def __getitem__(self, name: str) -> Callable[[], Formula]:
        families = (n for n in self.names if n.endswith("_"))
        if name in self.names or any(name.startswith(n) and name != n for n in families):
            return lambda: self.stand_in
        raise KeyError(name)

    def __iter__(self) -> Any:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


class _Reading:
    """Turns texts into formulas; one operator's texts share their names and limits."""

    def __init__(self, definitions: Definitions, variables: Variables, noises: Noises) -> None:
        self.definitions = definitions
        self.variables = variables
        self.noises = noises
        self.known: dict[str, Formula] = {}
        self.open: list[str] = []
        self.nodes = 0
        self.calls = 0

    def text(self, label: str, text: str) -> Formula:
        """Return the formula of one text; ``label`` begins the message of an error."""
        return _Text(self, label, text).read()

    def definition(self, name: str) -> Formula:
        """Return what a defined name stands for."""
        if name in self.known:
            return self.known[name]
        label = f"define.{name}"
        if name in self.open:
            chain = " > ".join([*self.open[self.open.index(name) :], name])
            raise ParameterError(f"{label}: is defined by itself ({chain})")
        if len(self.open) >= MOST_DEFINITIONS_DEEP:
            raise ParameterError(
                f"{label}: more than {MOST_DEFINITIONS_DEEP} definitions lead to it"
            )
        value = self.definitions[name]
        self.open.append(name)
        self.known[name] = _Text(self, label, str(value)).read()
        self.open.pop()
        return self.known[name]


class _Text:
    """One text being read."""

    def __init__(self, reading: _Reading, label: str, text: str) -> None:
        self.reading = reading
        self.label = label
        self.source = " ".join(text.split())
        self.calls = 0

    def read(self) -> Formula:
        """Return the formula."""
        if len(self.source) > LONGEST:
            raise self.refused(f"{len(self.source)} characters; must be at most {LONGEST}")
        tree = self._parsed()
        self._count(tree)
        try:
            return self._number(tree)
        except RecursionError:
            raise self.refused(
                "is nested too deep, with its definitions; write it flatter"
            ) from None

    def refused(self, reason: str, node: ast.AST | None = None) -> ParameterError:
        """Return the error that names what is wrong and where."""
        place = ""
        column = getattr(node, "col_offset", None)
        if node is not None and column is not None:
            part = ast.get_source_segment(self.source, node) or ""
            start = len(self.source.encode()[:column].decode(errors="ignore")) + 1
            place = f" at character {start}, {_shown(part)!r}"
        return ParameterError(f"{self.label} = {_shown(self.source)!r}{place}: {reason}")

    def _parsed(self) -> ast.expr:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.source, mode="eval").body
        except SyntaxError as error:
            place = f" (character {error.offset})" if error.offset else ""
            raise self.refused(f"is no arithmetic{place}; {ALLOWED}") from None
        except (ValueError, RecursionError, MemoryError):
            raise self.refused(f"is no arithmetic; {ALLOWED}") from None

    def _count(self, tree: ast.expr) -> None:
        """Refuse what is too large to be computed, without recursion."""
        waiting: list[tuple[ast.AST, int]] = [(tree, 1)]
        while waiting:
            node, depth = waiting.pop()
            self.reading.nodes += 1
            if depth > DEEPEST:
                raise self.refused(f"is nested more than {DEEPEST} deep; define parts of it")
            if self.reading.nodes > MOST_NODES:
                raise self.refused(f"more than {MOST_NODES} numbers, names and signs in all")
            parts = (p for p in ast.iter_child_nodes(node) if isinstance(p, ast.expr))
            waiting += [(part, depth + 1) for part in parts]

    def _number(self, node: ast.expr) -> Formula:
        """Return a formula that is a number, 1 or 0 for a comparison."""
        found = self._value(node)
        if found.is_condition:
            found = f.where(found, 1.0, 0.0)
        if found.op == "constant" and not abs(found.data) <= FLOAT_MAX:
            reason = "is no number" if math.isnan(found.data) else "is too large, or infinite"
            raise self.refused(f"{reason}; no division by zero, no root of a negative", node)
        return found

    def _condition(self, node: ast.expr) -> Formula:
        found = self._value(node)
        if not found.is_condition:
            raise self.refused("must be a comparison, such as x > 0", node)
        return found

    def _value(self, node: ast.expr) -> Formula:
        if isinstance(node, ast.Constant):
            return self._constant(node)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.UnaryOp):
            return self._unary(node)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.Compare):
            return self._comparison(node)
        if isinstance(node, ast.BoolOp):
            op = "both" if isinstance(node.op, ast.And) else "either"
            result, *others = (self._condition(value) for value in node.values)
            for other in others:
                result = apply(op, result, other)
            return result
        if isinstance(node, ast.IfExp):
            test = self._condition(node.test)
            return f.where(test, self._number(node.body), self._number(node.orelse))
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self.refused(f"is no arithmetic; {ALLOWED}", node)

    def _constant(self, node: ast.Constant) -> Formula:
        if isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
            try:
                return constant(float(node.value))
            except OverflowError:
                raise self.refused("is too large", node) from None
        raise self.refused(f"is no number; {ALLOWED}", node)

    def _name(self, node: ast.Name) -> Formula:
        name = node.id
        if name in CONSTANTS:
            return constant(CONSTANTS[name])
        if name in self.reading.definitions:
            return self.reading.definition(name)
        try:
            return self.reading.variables[name]()
        except KeyError:
            pass
        if name in FUNCTIONS or name in NOISES:
            raise self.refused(f"is a function; write {name}(...)", node)
        raise self.refused(self._unknown(name), node)

    def _unknown(self, name: str) -> str:
        from terrakit.parameters import suggestion

        names = [*CONSTANTS, *self.reading.definitions, *self.reading.variables]
        close = suggestion(name, [*names, *FUNCTIONS, *NOISES])
        hint = close if "did you mean" in close else ""
        return f"no such name{hint}; there are {', '.join(names)}, the functions and `define`"

    def _unary(self, node: ast.UnaryOp) -> Formula:
        if isinstance(node.op, ast.Not):
            return ~self._condition(node.operand)
        if isinstance(node.op, ast.USub):
            return -self._number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return self._number(node.operand)
        raise self.refused(f"is no arithmetic; {ALLOWED}", node)

    def _binary(self, node: ast.BinOp) -> Formula:
        compute = BINARY.get(type(node.op))
        if compute is None:
            hint = "powers are written **" if isinstance(node.op, ast.BitXor) else ALLOWED
            raise self.refused(f"is no arithmetic; {hint}", node)
        return compute(self._number(node.left), self._number(node.right))

    def _comparison(self, node: ast.Compare) -> Formula:
        sides = [self._number(side) for side in (node.left, *node.comparators)]
        result: Formula | None = None
        for op, a, b in zip(node.ops, sides, sides[1:], strict=False):
            compute = COMPARISONS.get(type(op))
            if compute is None:
                raise self.refused(f"is no arithmetic; {ALLOWED}", node)
            link = compute(a, b)
            result = link if result is None else result & link
        assert result is not None
        return result

    def _call(self, node: ast.Call) -> Formula:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in FUNCTIONS and name not in NOISES:
            if not name:
                raise self.refused(f"is no arithmetic; {ALLOWED}", node.func)
            raise self.refused(f"no such function; {ALLOWED}", node.func)
        starred = any(isinstance(arg, ast.Starred) for arg in node.args)
        if name in NOISES:
            if starred:
                raise self.refused(f"is no arithmetic; {ALLOWED}", node)
            return self._noise(node, name)
        least, most, compute = FUNCTIONS[name]
        if node.keywords or starred:
            raise self.refused(f"{name} takes plain arguments only", node)
        if not least <= len(node.args) <= most:
            wanted = str(least) if least == most else f"{least} to {most}"
            raise self.refused(f"{name} takes {wanted} arguments, not {len(node.args)}", node)
        return compute(*(self._number(arg) for arg in node.args))

    def _noise(self, node: ast.Call, name: str) -> Formula:
        """Return noise; each call in a text is a noise of its own."""
        wanted = NOISES[name]
        given: dict[str, ast.expr] = dict(zip(wanted, node.args, strict=False))
        if len(node.args) > len(wanted):
            raise self.refused(f"{name} takes {', '.join(wanted)} and no more", node)
        for keyword in node.keywords:
            if keyword.arg not in wanted or keyword.arg in given:
                raise self.refused(f"{name} takes {', '.join(wanted)}, each once", node)
            given[keyword.arg] = keyword.value
        if "wavelength" not in given:
            raise self.refused(f"{name} needs a wavelength in metres", node)
        self.reading.calls += 1
        if self.reading.calls > MOST_NOISES:
            raise self.refused(f"more than {MOST_NOISES} noises in all", node)
        settings: dict[str, Any] = {}
        for key, value in given.items():
            if key == "basis":
                settings[key] = self._basis(value)
                continue
            low, high = NOISE_BOUNDS[key]
            number = self._number(value)
            if number.op != "constant" or not low <= number.data <= high:
                raise self.refused(f"{key} must be a number from {low:g} to {high:g}", value)
            settings[key] = number.data
        octaves = settings.get("octaves", 1.0)
        if octaves != int(octaves):
            raise self.refused("octaves must be a whole number", node)
        if "octaves" in settings:
            settings["octaves"] = int(octaves)
        stream = f"{self.label} {self.calls}"
        self.calls += 1
        return self.reading.noises(NoiseCall(name, stream, **settings))

    def _basis(self, node: ast.expr) -> str:
        from terrakit.noise import BASES
        from terrakit.parameters import suggestion

        if isinstance(node, ast.Constant) and node.value in BASES:
            return str(node.value)
        given = str(node.value) if isinstance(node, ast.Constant) else ""
        raise self.refused(f"no such basis{suggestion(given, list(BASES))}", node)


def _shown(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."


def _exp2(a: Number) -> Formula:
    """Return 2 to the power ``a``, infinite where a float cannot hold it."""
    return f.where(as_formula(a) <= 127.0, f.exp2(a), INFINITY)


def _exp(a: Number) -> Formula:
    return _exp2(as_formula(a) * math.log2(math.e))


def _log2(a: Formula) -> Formula:
    return f.where(a > 0.0, f.log2(a), NAN)


def _power(a: Formula, b: Formula) -> Formula:
    """Return ``a ** b``; no number for a negative ``a``, unless ``b`` is a whole constant."""
    if b.op == "constant" and b.data == int(min(max(b.data, -1e9), 1e9)):
        whole = int(b.data)
        if abs(whole) <= LARGEST_WHOLE_POWER:
            return _whole_power(a, whole)
    risen = _exp2(b * f.log2(a))
    at_zero = f.where(b > 0.0, 0.0, f.where(b >= 0.0, 1.0, INFINITY))
    return f.where(a > 0.0, risen, f.where(a >= 0.0, at_zero, NAN))


def _whole_power(a: Formula, exponent: int) -> Formula:
    """Return a whole power by squaring."""
    result, square, rest = constant(1.0), a, abs(exponent)
    is_first = True
    while rest:
        if rest & 1:
            result = square if is_first else result * square
            is_first = False
        rest >>= 1
        if rest:
            square = square * square
    return result if exponent >= 0 else 1.0 / result


def _floor_divided(a: Formula, b: Formula) -> Formula:
    return f.floor(a / b)


def _remainder(a: Formula, b: Formula) -> Formula:
    return a - b * f.floor(a / b)


def _tangent(a: Formula) -> Formula:
    return f.sine(a) / f.cosine(a)


def _arcsine(a: Formula) -> Formula:
    other = f.sqrt(f.maximum(1.0 - a * a, 0.0))
    return f.where(f.absolute(a) <= 1.0, f.arctangent(a, other), NAN)


def _all(pair: Callable[[Number, Number], Formula]) -> Callable[..., Formula]:
    def over(first: Formula, *others: Formula) -> Formula:
        for other in others:
            first = pair(first, other)
        return first

    return over


def _sign(a: Formula) -> Formula:
    return f.where(a > 0.0, 1.0, f.where(a < 0.0, -1.0, 0.0))


FUNCTIONS: dict[str, tuple[int, int, Callable[..., Formula]]] = {
    "abs": (1, 1, f.absolute),
    "acos": (1, 1, lambda a: 0.5 * math.pi - _arcsine(a)),
    "asin": (1, 1, _arcsine),
    "atan": (1, 1, lambda a: f.arctangent(a, 1.0)),
    "atan2": (2, 2, f.arctangent),
    "ceil": (1, 1, lambda a: -f.floor(-a)),
    "clamp": (3, 3, f.clamp),
    "cos": (1, 1, f.cosine),
    "cosh": (1, 1, lambda a: (_exp(a) + _exp(-a)) * 0.5),
    "exp": (1, 1, _exp),
    "floor": (1, 1, f.floor),
    "hypot": (2, 2, f.hypot),
    "lerp": (3, 3, f.lerp),
    "log": (1, 1, lambda a: _log2(a) * math.log(2.0)),
    "log10": (1, 1, lambda a: _log2(a) * math.log10(2.0)),
    "log2": (1, 1, _log2),
    "max": (2, 16, _all(f.maximum)),
    "min": (2, 16, _all(f.minimum)),
    "round": (1, 1, lambda a: f.floor(a + 0.5)),
    "sign": (1, 1, _sign),
    "sin": (1, 1, f.sine),
    "sinh": (1, 1, lambda a: (_exp(a) - _exp(-a)) * 0.5),
    "smoothstep": (3, 3, f.smoothstep),
    "sqrt": (1, 1, f.sqrt),
    "tan": (1, 1, _tangent),
    "tanh": (1, 1, f.tanh),
}
"""Fewest and most arguments of each function, and the function."""
NOISES = {
    "billow": ("wavelength", "octaves", "gain", "basis"),
    "fbm": ("wavelength", "octaves", "gain", "basis"),
    "noise": ("wavelength", "basis"),
    "ridged": ("wavelength", "octaves", "gain", "basis"),
    "turbulence": ("wavelength", "octaves", "gain", "basis"),
}
"""Arguments of each noise, in order."""
NOISE_BOUNDS = {"wavelength": (0.001, 1e8), "octaves": (1.0, 24.0), "gain": (0.001, 1.0)}
BINARY: dict[type[ast.operator], Callable[[Formula, Formula], Formula]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.FloorDiv: _floor_divided,
    ast.Mod: _remainder,
    ast.Pow: _power,
}
COMPARISONS: dict[type[ast.cmpop], Callable[[Formula, Formula], Formula]] = {
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
    ast.Eq: lambda a, b: apply("equal", a, b),
    ast.NotEq: lambda a, b: ~apply("equal", a, b),
}
ALLOWED = (
    "use + - * / // % ** ( ), comparisons, `a if test else b` and "
    f"{', '.join(sorted({*FUNCTIONS, *NOISES}))}"
)
