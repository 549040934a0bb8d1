"""What is left out of Numba's front end, or done faster there, changes no answer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numba.core import event, ir, types
from numba.core.compiler import Flags, run_frontend
from numba.core.errors import TypingError
from numba.extending import overload

from renderer.kernels.jit import builder_kernel, entry_kernel, interface, kernel


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
