"""What is left out of Numba's front end, or done faster there, changes no answer."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from abc import ABCMeta
from pathlib import Path
from typing import NamedTuple

import llvmlite.ir as ll
import numpy as np
import pytest
from compiled_kernels import ROOT
from numba import njit
from numba.core import event, ir, types
from numba.core.compiler import Flags, run_frontend
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.extending import overload

from renderer.kernels.jit import builder_kernel, entry_kernel, interface, kernel, pack


def _of_many_parts(x, pair, numbers):
    total = 0
    for number in numbers:
        total += max(number, x, pair[0]) if number > pair[1] else -x
    numbers[0] = total
    return (total, numbers[1:], max(x, total))


def _variables(part) -> list[ir.Var]:
    """Return the variables of a part of a statement, by asking all there is to ask."""
    if isinstance(part, ir.Var):
        return [part]
    if isinstance(part, ir.Inst):
        return part.list_vars() if isinstance(part, ir.Expr) else _variables(vars(part))
    if isinstance(part, dict):
        return [v for one in part.values() for v in _variables(one)]
    if isinstance(part, list | tuple):
        return [v for one in part for v in _variables(one)]
    return []


def test_a_statement_lists_its_variables_in_order() -> None:
    blocks = run_frontend(_of_many_parts).blocks.values()
    statements = [statement for block in blocks for statement in block.body]
    found = [[v.name for v in statement.list_vars()] for statement in statements]
    assert found == [[v.name for v in _variables(vars(s))] for s in statements]
    calls = [
        [v.name for v in s.list_vars()]
        for s in statements
        if isinstance(s, ir.Assign) and getattr(s.value, "op", "") == "call"
    ]
    assert max(map(len, calls)) >= 5  # what is called, three arguments, the result


def test_options_are_equal_if_their_values_are() -> None:
    """Set to the default or not set is the same; a hash never tells equal ones apart."""
    unset, set_to_default, other = Flags(), Flags(), Flags()
    set_to_default.nrt = unset.nrt
    other.nrt = not unset.nrt
    assert unset == set_to_default and hash(unset) == hash(set_to_default)
    assert unset != other and set_to_default != other
    assert unset.values()["nrt"] == set_to_default.values()["nrt"] != other.values()["nrt"]
    assert set(unset.values()) == set(Flags.options)


def _not_kept(text: str, **names):
    """Return an entry kernel that no cache has, as it has no source file."""
    return entry_kernel(eval(text, names))


def test_a_listener_hears_of_a_compilation() -> None:
    """Events are made as soon as somebody listens: the progress display does."""
    with event.install_recorder("numba:compile") as heard:
        assert _not_kept("lambda: 1")() == 1
    assert [e.is_start for _, e in heard.buffer] == [True, False]


def _later(x):
    """What has no meaning until a test gives it one."""


def test_what_is_registered_later_is_found() -> None:
    """Only registries that have grown are read again: this one has."""
    with pytest.raises(TypingError):
        _not_kept("lambda x: later(x)", later=_later)(1.0)

    @overload(_later)
    def choose(x):
        return lambda x: x + 41.0

    assert _not_kept("lambda x: later(x)", later=_later)(1.0) == 42.0


def test_a_call_that_means_nothing_is_explained() -> None:
    @entry_kernel
    def adds(x):
        return x + "text"

    with pytest.raises(TypingError, match="No implementation of function"):
        adds(1.0)


def test_a_constant_is_asked_for_by_its_value_where_its_type_does_not_fit() -> None:
    """A meaning is asked without a constant's value, then with it."""
    asked = []

    def takes_three(x):
        """Fit the value 3 alone."""

    @overload(takes_three)
    def choose(x):
        asked.append(x)
        three = isinstance(x, types.IntegerLiteral) and x.literal_value == 3
        return (lambda x: 3) if three else None

    assert _not_kept("lambda: takes_three(3)", takes_three=takes_three)() == 3
    assert types.int64 in asked and asked[-1] == types.literal(3)


def test_each_constant_has_its_own_meaning() -> None:
    """What a call means is remembered by its constants' values as well."""

    def named(x, by=0):
        """Stand for the numbers that the overload gives."""

    @overload(named, prefer_literal=True)
    def choose(x, by=0):
        number = x.literal_value if isinstance(x, types.Literal) else -1
        step = by.literal_value if isinstance(by, types.Literal) else -2
        return lambda x, by=0: 10 * number + step

    calls = "lambda y: (named(3, by=1), named(4, by=1), named(4, by=2), named(y, by=1))"
    assert _not_kept(calls, named=named)(3) == (31, 41, 42, -9)


def test_a_meaning_has_the_options_of_its_caller() -> None:
    """Else whoever compiles first decides for all: here, what a division by zero is."""

    def divide(x, y):
        """Stand for the division that the overload gives."""

    @overload(divide)
    def choose(x, y):
        return lambda x, y: x / y

    division = "lambda x, y: divide(x, y)"
    assert _not_kept(division, divide=divide)(1.0, 0.0) == np.inf
    with pytest.raises(ZeroDivisionError):
        njit(eval(division, {"divide": divide}))(1.0, 0.0)


def test_what_is_allocated_is_counted_whoever_asked_first() -> None:
    """A kernel without reference counts makes nobody else's array free too early."""

    def same(x):
        """Stand for what the overload gives."""

    @overload(same)
    def choose(x):
        return lambda x: x

    assert _not_kept("lambda x: same(x)[0]", same=same)(np.ones(3)) == 1.0
    allocate = builder_kernel(eval("lambda n: same(np.ones(n))", {"same": same, "np": np}))
    arrays = [allocate(1000) for _ in range(5)]
    assert all(sys.getrefcount(array.base) == 2 and array.all() for array in arrays)


class _Pair(NamedTuple):
    numbers: np.ndarray


def test_an_implementation_that_is_replaced_is_not_remembered() -> None:
    @interface
    def value(pair):
        """Give a number."""

    given = pack(_Pair(np.full(2, 1.5)))
    found = []
    for text in ("lambda pair: 3", "lambda pair: 2.0 * pair.numbers[0]"):
        value.by(_Pair)(kernel(eval(text)))
        found.append(_not_kept("lambda pair: value(pair)", value=value)(given))
    assert found == [3, 3.0] and list(map(type, found)) == [int, float]


def test_a_list_of_several_types_has_a_length() -> None:
    """Its type is one that constants alone have, which Numba refuses elsewhere."""
    assert _not_kept("lambda: len([1, 'a', 2j])")() == 3


def test_types_are_what_their_classes_say() -> None:
    """Python asks registries of abstract classes, in which no Numba type is."""
    few = [
        types.int64,
        types.literal(3),
        types.float32[:, ::1],
        types.UniTuple(types.b1, 2),
    ]
    classes = [one for one in vars(types).values() if isinstance(one, type(types.Type))]
    assert len(classes) > 50
    for numba_type, one in itertools.product(few, classes):
        by_registry = ABCMeta.__subclasscheck__(one, type(numba_type))
        assert isinstance(numba_type, one) == by_registry, (numba_type, one)
        assert issubclass(type(numba_type), one) == by_registry


def test_an_error_says_where_it_is() -> None:
    """The statement, by file and line, and the kernel that calls."""

    @kernel
    def inner(x):
        return x + "text"

    @entry_kernel
    def outer(x):
        return inner(x)

    with pytest.raises(TypingError) as found:
        outer(1.0)
    text = str(found.value)
    line = inner.py_func.__code__.co_firstlineno + 2
    assert re.search(
        rf"During: typing of intrinsic-call at .*{Path(__file__).name} \({line}\)", text
    )
    assert "resolving callee type: type(CPUDispatcher(<function" in text and "inner" in text


@pytest.mark.parametrize(
    "of",
    [
        ll.IntType(1),
        ll.DoubleType(),
        ll.VectorType(ll.FloatType(), 16),
        ll.ArrayType(ll.IntType(24), 3),
        ll.LiteralStructType([ll.IntType(8), ll.DoubleType()]),
        ll.PointerType(),
    ],
    ids=str,
)
def test_a_type_is_as_large_as_llvm_says(of) -> None:
    """For the first time and from memory."""
    context = cpu_target.target_context
    size = of.get_abi_size(context.target_data)
    assert [context.get_abi_sizeof(of) for _ in range(2)] == [size, size]


def test_scipy_is_imported_for_linear_algebra_alone() -> None:
    program = """
import sys
import numba, numpy
from renderer.kernels.jit import entry_kernel
assert entry_kernel(eval("lambda x: x + 1"))(1) == 2
assert "scipy.linalg" not in sys.modules
twice = numpy.diag((2.0, 2.0))
for product in (lambda a: a @ a, lambda a: numpy.kron(a, a)[:2, :2]):
    assert (numba.njit(product)(twice) == 2 * twice).all()
assert "scipy.linalg" in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


# -------------------------------------------------------------------- what is left out


def test_a_kernel_may_have_a_function_inside_of_it() -> None:
    """Then the passes of closures run."""

    @entry_kernel
    def outer(x):
        def twice(y):
            return 2 * y

        return twice(x) + twice(1)

    assert outer(20) == 42


def test_a_builder_may_compute_with_whole_arrays() -> None:
    @builder_kernel
    def polynomial(x):
        return (2.0 * x + 1.0) * x

    assert polynomial(np.arange(4.0)).tolist() == [0.0, 3.0, 10.0, 21.0]


def test_an_array_that_does_not_fit_into_another_is_an_error() -> None:
    """Without the text of the error, that is without strings in the kernel."""

    @builder_kernel
    def copied(target, source):
        target[:] = source
        return target

    with event.install_recorder("numba:compile") as heard:
        assert copied(np.zeros(2), np.ones(2)).tolist() == [1.0, 1.0]
    compiled = {e.data["dispatcher"].py_func.__module__ for _, e in heard.buffer}
    assert "numba.cpython.unicode" not in compiled
    with pytest.raises(ValueError, match="cannot assign slice"):
        copied(np.zeros(2), np.ones(3))


def test_a_branch_for_none_is_not_compiled() -> None:
    """The pruning of dead branches stays: absent tables are None."""

    @entry_kernel
    def first(table):
        if table is None:
            return -1.0
        return table[0]

    assert first(None) == -1.0
    assert first(np.array([7.0])) == 7.0


class Bar(NamedTuple):
    """A record for the interface below."""

    length: float


@interface
def _stretched(bar, factor):
    """Return a length times a factor."""


@_stretched.by(Bar)
@kernel
def _stretched_bar(bar, factor):
    return factor * bar.length


def test_an_interface_takes_arguments_by_name() -> None:
    call = entry_kernel(lambda bar, factor: _stretched(factor=factor, bar=bar))
    assert call(Bar(2.0), 3.0) == 6.0
