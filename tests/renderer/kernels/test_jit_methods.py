"""Kernels called by their address, and functions chosen by their first argument."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core import types
from numba.core.errors import TypingError

from renderer.kernels.jit import (
    call,
    compile_method,
    count_of,
    entry_kernel,
    interface,
    kernel,
    method_kernel,
    pack,
)

INT, FLOAT = types.int64, types.float64
COLUMN = types.Array(types.float64, 1, "C")


class Values(NamedTuple):
    values: Any


class Limit(NamedTuple):
    most: int


# ---------------------------------------------------------------------------- methods


@method_kernel
def count_above(table, limit):
    count = 0
    for value in table.values:
        if value > limit:
            count += 1
    return count


@method_kernel
def count_at_most(table, limit):
    if limit < 0.0:
        raise ValueError("limits are positive")
    return min(table.most, np.int64(limit))


@method_kernel
def copy_values(table, out):
    for k in range(table.values.size):
        out[k] = table.values[k]


@method_kernel
def refuse(table, out):
    if out.size > 1:
        raise ValueError("out of room")


@kernel
def linked_only(table, limit):
    return np.int64(0)


@entry_kernel
def run_count(address, record, limit):
    return count_of(address, record, (limit,))


@entry_kernel
def run_call(address, record, out):
    call(address, record, (out,))


def test_methods_are_called_by_their_address() -> None:
    """One caller for all kinds of records, compiled once; records of a kind share code."""
    few, many = pack(Values(np.array([1.0, 5.0]))), pack(Values(np.arange(100.0)))
    limit = pack(Limit(3))
    one = compile_method(count_above, few, FLOAT, returns=INT)
    two = compile_method(count_above, many, FLOAT, returns=INT)
    other = compile_method(count_at_most, limit, FLOAT, returns=INT)
    assert one.address == two.address != other.address
    assert [run_count(*method, 2.0) for method in (one, two, other)] == [1, 97, 2]
    assert run_count(*other, 9.0) == 3
    assert len(run_count.signatures) == 1
    assert 0 not in (one.address, one.record)


def test_a_method_that_returns_nothing() -> None:
    out = np.zeros(3)
    packed = pack(Values(np.array([1.0, 2.0, 3.0])))
    run_call(*compile_method(copy_values, packed, COLUMN), out)
    np.testing.assert_array_equal(out, [1, 2, 3])


def test_the_record_is_found_by_its_address_at_each_call() -> None:
    """A change of its arrays is seen."""
    values = np.zeros(3)
    packed = pack(Values(values))
    method = compile_method(count_above, packed, FLOAT, returns=INT)
    assert run_count(*method, 0.5) == 0
    values[:2] = 1.0
    assert run_count(*method, 0.5) == 2


@pytest.mark.parametrize(
    ("method", "argument", "returns", "found"),
    [
        (count_above, FLOAT, types.none, "count_above returns int64, not none"),
        (count_above, FLOAT, types.int32, "count_above returns int64, not int32"),
        (copy_values, COLUMN, INT, "copy_values returns none, not int64"),
    ],
)
def test_another_type_of_result_is_refused(method, argument, returns, found) -> None:
    """Its caller would read what is not there."""
    with pytest.raises(TypeError, match=found):
        compile_method(method, pack(Values(np.zeros(1))), argument, returns=returns)


def test_a_kernel_that_is_only_linked_has_no_address() -> None:
    with pytest.raises(TypeError, match="linked_only has no machine code of its own"):
        compile_method(linked_only, pack(Limit(1)), FLOAT, returns=INT)


@entry_kernel
def run_narrow(address, record, limit):
    return count_of(address, record, (np.int32(limit),))


def test_an_integer_that_fills_no_register_is_refused() -> None:
    """The upper half of its register would be whatever was there before."""
    counting = compile_method(count_at_most, pack(Limit(3)), FLOAT, returns=INT)
    with pytest.raises(TypingError, match="methods take int64 and floats, not int32"):
        run_narrow(*counting, 2)


def test_an_exception_in_a_method_reaches_python() -> None:
    """Of both kinds of calls; and the next call is as if there had been none."""
    limit = pack(Limit(3))
    counting = compile_method(count_at_most, limit, FLOAT, returns=INT)
    with pytest.raises(ValueError, match="limits are positive"):
        run_count(*counting, -1.0)
    assert run_count(*counting, 1.0) == 1
    packed = pack(Limit(0))
    refusing = compile_method(refuse, packed, COLUMN)
    with pytest.raises(ValueError, match="out of room"):
        run_call(*refusing, np.zeros(2))
    run_call(*refusing, np.zeros(1))


# ------------------------------------------------------------------------- interfaces


class Square(NamedTuple):
    side: float


class Circle(NamedTuple):
    radius: float


class Ball(NamedTuple):
    radius: float


class Point(NamedTuple):
    where: float


@interface
def extent_of(shape: Any, scale: float) -> float:
    """Return how large a shape is."""


@extent_of.by(Square)
@kernel
def _extent_of_square(shape, scale):
    return scale * shape.side


@extent_of.by(Circle, Ball)
@kernel
def _extent_of_round(shape, scale):
    return scale * 2.0 * shape.radius


@entry_kernel
def run_extent(shape, scale):
    return extent_of(shape, scale)


def test_an_implementation_is_chosen_by_the_record() -> None:
    """Packed or by value; one may serve several classes."""
    for shape, expected in ((Square(3.0), 6.0), (Circle(3.0), 12.0), (Ball(1.0), 4.0)):
        assert run_extent(shape, 2.0) == run_extent(pack(shape), 2.0) == expected


def test_a_record_that_nobody_knows_is_an_error_that_names_the_known_ones() -> None:
    expected = "extent_of exists for Square, Circle, Ball, not for "
    with pytest.raises(TypingError, match=expected + r"Record\.Point"):
        run_extent(pack(Point(1.0)), 2.0)
    with pytest.raises(TypingError, match=expected + "float64"):
        run_extent(1.0, 2.0)


def test_an_interface_says_what_it_is() -> None:
    assert (extent_of.__name__, extent_of.__doc__) == (
        "extent_of",
        "Return how large a shape is.",
    )
    with pytest.raises(TypeError, match="extent_of can be called inside kernels only"):
        extent_of(Square(1.0), 2.0)


def test_an_interface_takes_arguments_by_name() -> None:
    call = entry_kernel(lambda shape, scale: extent_of(scale=scale, shape=shape))
    assert call(Square(2.0), 3.0) == 6.0
