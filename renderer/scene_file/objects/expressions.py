"""Functions g(x, y, z) as programs, from text or from a Python function.

A program is a sequence of operations for a stack machine. So kernels evaluate any function
without compiling it, for numbers and for intervals (`plugins.shapes.intervals`).

Every operation is defined everywhere, since an interval must have a value: the root of a
negative number is 0, and a quotient by 0 has no value that could be a root.
"""

from __future__ import annotations

import ast
import inspect
import math
import operator
import warnings
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from renderer.scene_file.description import Program

# operations; the last four have two operands, those before one, the first four none
CONSTANT, X, Y, Z = 0, 1, 2, 3
NEGATE, POWER, SIN, COS, SQRT, EXP, ABS = 4, 5, 6, 7, 8, 9, 10
ADD, SUBTRACT, MULTIPLY, DIVIDE, MIN, MAX = 11, 12, 13, 14, 15, 16

DEEPEST_STACK = 64  # numbers on the stack
LONGEST = 4096  # operations
HIGHEST_POWER = 64

_VARIABLES = {"x": X, "y": Y, "z": Z}
_FUNCTIONS = {"sin": SIN, "cos": COS, "sqrt": SQRT, "exp": EXP, "abs": ABS}
_BINARY_FUNCTIONS = {"min": MIN, "max": MAX}
_OPERATORS: dict[type[ast.operator], int] = {
    ast.Add: ADD,
    ast.Sub: SUBTRACT,
    ast.Mult: MULTIPLY,
    ast.Div: DIVIDE,
}
_OF_CONSTANTS: dict[int, Callable[[float, float], float]] = {
    ADD: operator.add,
    SUBTRACT: operator.sub,
    MULTIPLY: operator.mul,
    DIVIDE: operator.truediv,
    MIN: min,
    MAX: max,
}
_POSSIBLE = (
    "numbers, x, y, z, + - * / ^ ( ), "
    f"{', '.join((*_FUNCTIONS, *_BINARY_FUNCTIONS))} and pi"
)


class ExpressionError(ValueError):
    """An error in a function, without its place in the file."""


def _operators(operation: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the methods of a `Term` for an operator, with the term on either side."""

    def left(term: Term, other: Any) -> Term:
        return term._with(other, operation)

    def right(term: Term, other: Any) -> Term:
        return as_term(other)._with(term, operation)

    return left, right


class Term:
    """A part of a function, as the operations that compute it."""

    __array_priority__ = 1000.0  # NumPy scalars use this class's operators
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, steps: tuple[tuple[int, float], ...]) -> None:
        if len(steps) > LONGEST:
            raise ExpressionError(f"it has more than {LONGEST} operations")
        self.steps = steps

    def _with(self, other: Any, operation: int) -> Term:
        steps = (*self.steps, *as_term(other).steps)
        if len(steps) == 2 and steps[0][0] == steps[1][0] == CONSTANT:
            (_, a), (_, b) = steps
            if not (operation == DIVIDE and b == 0.0):
                return as_term(_OF_CONSTANTS[operation](a, b))
        return Term((*steps, (operation, 0.0)))

    __add__, __radd__ = _operators(ADD)
    __sub__, __rsub__ = _operators(SUBTRACT)
    __mul__, __rmul__ = _operators(MULTIPLY)
    __truediv__, __rtruediv__ = _operators(DIVIDE)

    def __neg__(self) -> Term:
        """Return -g."""
        return Term((*self.steps, (NEGATE, 0.0)))

    def __pos__(self) -> Term:
        """Return g."""
        return self

    def __abs__(self) -> Term:
        """Return |g|."""
        return Term((*self.steps, (ABS, 0.0)))

    def __pow__(self, exponent: Any) -> Term:
        """Return g to the power of an integer."""
        number = float(exponent) if isinstance(exponent, int | float) else math.nan
        if number != round_or_nan(number) or not 0 <= abs(number) <= HIGHEST_POWER:
            raise ExpressionError(
                f"an exponent must be an integer from -{HIGHEST_POWER} to {HIGHEST_POWER}; "
                "sqrt and exp give others"
            )
        raised = Term((*self.steps, (POWER, abs(number))))
        return 1.0 / raised if number < 0 else raised

    def __bool__(self) -> NoReturn:
        """Raise an error: a term has no truth value."""
        raise ExpressionError("it compares what is not yet a number; min and max choose")

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **other: Any) -> Any:
        """Support `np.sin(x)` and other NumPy functions that are in the language."""
        name = {"absolute": "abs", "minimum": "min", "maximum": "max"}.get(
            ufunc.__name__, ufunc.__name__
        )
        operators = {"add": ADD, "subtract": SUBTRACT, "multiply": MULTIPLY}
        operators |= {"divide": DIVIDE} | _BINARY_FUNCTIONS
        terms = [as_term(given) for given in inputs]
        if method == "__call__" and not other:
            if name in _FUNCTIONS:
                return Term((*terms[0].steps, (_FUNCTIONS[name], 0.0)))
            if name in operators:
                return terms[0]._with(terms[1], operators[name])
        raise ExpressionError(f"np.{ufunc.__name__} is not possible; possible: {_POSSIBLE}")


def round_or_nan(number: float) -> float:
    """Return the nearest integer; NaN if it is not finite."""
    return float(round(number)) if math.isfinite(number) else math.nan


def as_term(value: Any) -> Term:
    """Return a term; for a number the constant."""
    if isinstance(value, Term):
        return value
    if isinstance(value, bool | str) or not isinstance(value, int | float | np.number):
        raise ExpressionError(f"it uses a {type(value).__name__} as a number")
    if not math.isfinite(number := float(value)):
        raise ExpressionError(f"it has the constant {number}")
    return Term(((CONSTANT, number),))


def parse_expression(text: str) -> Program:
    """Return the program of an expression of a file; `^` and `**` are powers.

    Raises
    ------
    ExpressionError
        If anything in it is not part of the language.
    """
    source = text.replace("^", "**").strip()
    if len(source) > 16 * LONGEST:
        raise ExpressionError(f"it has more than {16 * LONGEST} characters")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python warns of `2(x)`, an error here anyway
            tree = ast.parse(source, mode="eval")
        term = _term(tree.body)
    except (SyntaxError, SyntaxWarning, MemoryError, OverflowError) as error:
        said = error.msg if isinstance(error, SyntaxError) else str(error)
        raise ExpressionError(f"it is no expression: {said}") from None
    except ValueError as error:
        if isinstance(error, ExpressionError):
            raise
        raise ExpressionError(f"it is no expression: {error}") from None
    except RecursionError:
        raise ExpressionError("it is nested too deep") from None
    return _program(term, text)


def _term(node: ast.expr) -> Term:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return as_term(value)
        case ast.Name(id="pi"):
            return as_term(math.pi)
        case ast.Name(id=name) if name in _VARIABLES:
            return Term(((_VARIABLES[name], 0.0),))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_term(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _term(operand)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _term(left) ** _number(right)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _term(left)._with(_term(right), _OPERATORS[type(op)])
        case ast.Call(func=ast.Name(id=name), args=[one], keywords=[]) if (
            name in _FUNCTIONS
        ):
            return Term((*_term(one).steps, (_FUNCTIONS[name], 0.0)))
        case ast.Call(func=ast.Name(id=name), args=[first, second, *more], keywords=[]) if (
            name in _BINARY_FUNCTIONS
        ):
            term = _term(first)
            for other in (second, *more):
                term = term._with(_term(other), _BINARY_FUNCTIONS[name])
            return term
    raise ExpressionError(
        f"`{ast.unparse(node)[:60]}` is not possible; possible: {_POSSIBLE}"
    )


def _number(node: ast.expr) -> float:
    """Return the value of an exponent."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_number(operand)
    return math.nan


def trace_function(function: Callable[..., Any]) -> Program:
    """Return the program of a Python function of x, y and z.

    The function is called once, with terms in place of numbers. Operators and NumPy
    functions record the operations. Branches that depend on x, y or z are not possible.

    Raises
    ------
    ExpressionError
        If it raises an exception, or uses anything that is not in the language.
    """
    name = getattr(function, "__name__", type(function).__name__)
    try:
        inspect.signature(function).bind(None, None, None)
    except (TypeError, ValueError):
        raise ExpressionError(f"{name} cannot be called with x, y, z") from None
    try:
        found = function(*(Term(((variable, 0.0),)) for variable in (X, Y, Z)))
    except ExpressionError:
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        raise ExpressionError(f"{name} raises {said}") from None
    return _program(as_term(found), name)


def _program(term: Term, text: str) -> Program:
    waiting = deepest = 0
    for operation, _ in term.steps:
        waiting += 1 if operation <= Z else -1 if operation >= ADD else 0
        deepest = max(deepest, waiting)
    if deepest > DEEPEST_STACK:
        raise ExpressionError(
            f"{deepest} numbers wait for others; possible are {DEEPEST_STACK} "
            "(write a + (b + (c ...)) as a + b + c ...)"
        )
    operations, operands = zip(*term.steps, strict=True)
    return Program(np.array(operations, np.int32), np.array(operands, np.float64), text)
