"""Records behind a pointer: kernels read what Python has packed, of the same types."""

from __future__ import annotations

import gc
import importlib
import pickle
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core import types

from renderer.errors import SceneError
from renderer.kernels.jit import (
    Packed,
    by_columns,
    entry_kernel,
    kernel,
    pack,
    record_type,
    table_columns,
)


def pickled(rows: Any) -> Any:
    return pickle.loads(pickle.dumps(by_columns(rows)))


class Inner(NamedTuple):
    weight: Any
    nothing: Any
    values: Any


class Outer(NamedTuple):
    count: Any
    inner: Any
    nothing: Any
    last: Any


class One(NamedTuple):
    value: Any


@kernel
def is_there(value):
    return 0 if value is None else 1


@entry_kernel
def read(record, out):
    """Look at every field, through both levels."""
    out[0] = record.count
    out[1] = record.inner.weight
    out[2] = is_there(record.inner.nothing)
    out[3] = record.inner.values[1]
    out[4] = is_there(record.nothing)
    out[5] = record.last


@entry_kernel
def value_of(record):
    return record.value


@entry_kernel
def three_dimensions(record, out):
    for k in range(3):
        out[k] = record.value.shape[k]
    out[3] = record.value[1, 2, 3]
    out[4] = record.value.size


@entry_kernel
def two_dimensions(record, out):
    for k in range(2):
        out[k] = record.value.shape[k]
    out[2] = record.value[1, 2]
    row = record.value[1]
    out[3] = row[0]
    out[4] = record.value.size
    record.value[0, 0] = 77


def test_records_in_records_with_numbers_and_nothing() -> None:
    """A None takes no room: what stands behind it is read from the right place."""
    out = np.zeros(6)
    inner = Inner(0.1, None, np.array([3.0, 4.0]))
    read(pack(Outer(2**40, inner, None, -1.5)), out)
    np.testing.assert_array_equal(out, [2**40, 0.1, 0, 4, 0, -1.5])
    read(pack(Outer(7, inner._replace(nothing=5), 6, 2.5)), out)
    np.testing.assert_array_equal(out, [7, 0.1, 1, 4, 1, 2.5])


@pytest.mark.parametrize(
    ("value", "numba_type"),
    [
        (3, types.int64),
        (True, types.int64),
        (0.1, types.float64),
        (np.float64(0.1), types.float64),
        (np.float32(0.1), types.float32),
        (np.int32(-(2**31)), types.int32),
        (np.uint8(255), types.uint8),
        (np.uint64(2**64 - 1), types.uint64),
        (np.int64(-(2**63)), types.int64),
        (np.bool_(True), types.boolean),
    ],
)
def test_numbers_keep_their_type(value, numba_type) -> None:
    packed = pack(One(value))
    assert packed.numba_type.record.types[0] == numba_type
    assert value_of(packed) == value


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.uint8])
def test_arrays_of_two_and_three_dimensions(dtype) -> None:
    """Any shape is of one type; a change by a kernel is one of the array."""
    cube = np.arange(2 * 5 * 7).reshape(2, 5, 7).astype(dtype)
    out = np.zeros(5)
    three_dimensions(pack(One(cube)), out)
    np.testing.assert_array_equal(out, [2, 5, 7, cube[1, 2, 3], cube.size])
    table = np.arange(12).reshape(3, 4).astype(dtype)
    two_dimensions(pack(One(table)), out)
    np.testing.assert_array_equal(out, [3, 4, 6, 4, 12])
    assert table[0, 0] == 77
    other = np.zeros((9, 5), dtype)
    assert record_type(One(table)) == record_type(One(other)) != record_type(One(cube))
    two_dimensions(pack(One(other)), out)
    np.testing.assert_array_equal(out, [9, 5, 0, 0, 45])
    assert sum(args[0] == record_type(One(table)) for args in two_dimensions.overloads) == 1


def test_arrays_are_shared_and_numbers_are_copied() -> None:
    values, out = np.array([1.0, 2.0]), np.zeros(6)
    packed = pack(Outer(1, Inner(1.0, None, values), None, 2.0))
    values[1] = 9.0
    read(packed, out)
    assert out[3] == 9.0


def test_a_packed_record_keeps_its_arrays_alive() -> None:
    def packed_cube() -> Packed:
        return pack(One(np.full((2, 3, 4), 5.0)))

    packed, out = packed_cube(), np.zeros(5)
    gc.collect()
    _other = [np.ones((2, 3, 4)) for _ in range(100)]
    three_dimensions(packed, out)
    assert out[3] == 5.0


@entry_kernel
def weight_behind(record):
    return record.value.weight + record.value.values[0]


def test_a_record_may_hold_the_address_of_another() -> None:
    inner = pack(Inner(0.5, None, np.array([2.0])))
    assert weight_behind(pack(One(inner))) == 2.5


def test_what_is_not_c_ordered_is_refused() -> None:
    """Strides are computed from the shape, so any other order would be misread."""
    deep, wide = np.zeros((2, 3, 4)).T, np.zeros((8, 3))
    for array in (deep, wide[:, ::2], wide[::2].T, np.zeros(8)[::-1]):
        with pytest.raises(TypeError, match=r"an array of shape \(.*\) is not C-ordered"):
            pack(One(array))


@table_columns("rows")
class Table(NamedTuple):
    """A table that lies in memory column by column."""

    rows: Any


@entry_kernel
def shape_and_sum(record, out):
    rows = record.rows
    out[0], out[1] = rows.shape[0], rows.shape[1]
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            out[2] += rows[i, k] * (10 * i + k)


@pytest.mark.parametrize("columns", [0, 1, 5])
@pytest.mark.parametrize("laid_out", [by_columns, pickled, np.ascontiguousarray])
def test_tables_by_columns(columns, laid_out) -> None:
    """Of one type and read right, also of one column or none, and however they lay."""
    plain = np.arange(3.0 * columns, dtype=np.float32).reshape(3, columns)
    packed, out = pack(Table(laid_out(plain))), np.zeros(3)
    assert packed.numba_type == record_type(Table(by_columns(np.ones((3, 7)))))
    gc.collect()
    shape_and_sum(packed, out)
    weights = 10 * np.arange(3)[:, None] + np.arange(columns)
    assert out.tolist() == [3, columns, (plain * weights).sum()]


def test_rows_of_one_column_stay_rows() -> None:
    """NumPy leaves the transpose of a single row as it lies; its type must not change."""
    one, two = (np.ascontiguousarray(np.ones((n, 3)).T) for n in (1, 2))
    assert record_type(One(one)) == record_type(One(two))


def test_a_table_beyond_32_bits_is_refused() -> None:
    most = np.broadcast_to(np.float32(0.0), (12, 2**31 // 12))
    with pytest.raises(SceneError, match="too large: 2\\^31 fit"):
        by_columns(most)


@pytest.mark.parametrize("value", ["text", [1, 2], {"a": 1}, object()])
def test_what_kernels_cannot_read_is_refused(value) -> None:
    expected = f"record cannot hold a {type(value).__name__}"
    with pytest.raises(TypeError, match=expected):
        pack(One(value))


def test_types_tell_records_apart() -> None:
    """By class, by the types of the fields, and by the source of a user's own kind."""
    assert record_type(One(1)) == pack(One(2)).numba_type
    different = [
        record_type(One(1)),
        record_type(One(1.0)),
        record_type(One(None)),
        record_type(One(np.zeros(1))),
        record_type(One(np.zeros((1, 1)))),
        record_type(One(One(1))),
        record_type(One(1), source="an edit"),
        record_type(Inner(1, 1, 1)),
    ]
    assert len({str(one) for one in different}) == len(set(different)) == len(different)


def test_the_text_of_a_users_file_tells_its_records_apart(tmp_path, monkeypatch) -> None:
    """Kernels are kept by the names of types, and are chosen by classes within records."""
    names = []
    for text in ("", "# edited\n"):
        place = tmp_path / f"of_{len(text)}"
        place.mkdir()
        (place / "my_record.py").write_text(
            f"{text}from typing import NamedTuple\nclass Mine(NamedTuple):\n    x: float\n"
        )
        with monkeypatch.context() as patch:
            patch.syspath_prepend(place)
            patch.delitem(sys.modules, "my_record", raising=False)
            mine = importlib.import_module("my_record").Mine
            names.append(record_type(One(mine(1.0))).name)
            del sys.modules["my_record"]
    assert names[0] != names[1]
    assert names[0].startswith("Record.One.")
