"""Records for kernels: NamedTuples packed into one buffer, and column-major tables.

In a column-major table the numbers of one item are contiguous, so that a gather of one
item touches few cache lines. The gathers are in `renderer.kernels.lanes.memory`.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.serialize import dumps
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import make_array
from numba.np.numpy_support import as_dtype, from_dtype
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit.cache import file_digest

_FIELDS: dict[type, frozenset[str]] = {}
_MOST_NUMBERS = 2**31  # kernels index them with 32 bits
Record = TypeVar("Record")


def table_columns(*names: str) -> Callable[[type[Record]], type[Record]]:
    """Declare which fields of a NamedTuple are column-major tables (k, n).

    The class declares it because strides cannot tell: NumPy takes a single column for rows
    as well, and copies of a table lose their layout.
    """

    def noted(record: type[Record]) -> type[Record]:
        _FIELDS[record] = frozenset(names)
        return record

    return noted


def by_columns(rows: Any) -> NDArray[Any]:
    """Return a column-major table (k, n) of 32-bit numbers.

    Doubles become single precision. A column of zeros is added in memory behind the last:
    lanes outside a mask read column 0, which must exist.

    Raises
    ------
    SceneError
        For 2^31 numbers or more.
    """
    size, count = rows.shape
    table = column_rows(size, count, rows.dtype if rows.dtype.itemsize == 4 else np.float32)
    table[:count] = rows.T
    return table[:count].T


def column_rows(size: int, count: int, dtype: Any = np.float32) -> NDArray[Any]:
    """Return zeros (count + 1, size); without the last row, its transpose is a table."""
    if (count + 1) * size >= _MOST_NUMBERS:
        raise SceneError(f"a table of {count} times {size} numbers is too large: 2^31 fit")
    return np.zeros((count + 1, size), dtype)


def column_fields(record: type) -> frozenset[str]:
    """Return the fields declared by `table_columns`."""
    return _FIELDS.get(record, frozenset())


def lies_by_columns(table: NDArray[Any]) -> bool:
    """Return whether a table has the layout of `by_columns`."""
    return table.strides == (table.itemsize, table.itemsize * table.shape[0])


# ------------------------------------------------------------------------------ records
# Records that kernels see through a pointer.
#
# A NamedTuple of arrays, passed by value, is some hundred arguments, and each function that
# it is passed to gets a new signature. `pack` writes the leaves (pointers, shapes, numbers)
# into one buffer, and kernels get its address. They read attributes as before:
# `scene.lights.count` is a load, and `x is None` is still decided at compile time.

_I64 = ir.IntType(64)
_POINTER = ir.IntType(8).as_pointer()
_WORD = 8  # bytes


class RecordType(types.Type):  # type: ignore[misc]  # Numba has no types
    """Numba type of a pointer to a packed record.

    Parameters
    ----------
    record
        The Numba type of the NamedTuple.
    source
        Distinguishes records of one class whose kernels have changed: a hash of the file
        that a user's plugin comes from. Empty for the renderer's own.
    """

    def __init__(self, record: Any, source: str = "") -> None:
        self.record, self.source = record, source
        cls = record.instance_class
        files = " ".join(sorted(_files_of(record)))
        exact = f"{cls.__module__}.{cls.__qualname__} {record.name} {source} {files}"
        digest = hashlib.sha256(exact.encode()).hexdigest()[:12]
        super().__init__(name=f"Record.{cls.__name__}.{digest}")
        self.words = _words(record)

    def __reduce__(self) -> Any:
        """Pickle the class separately: a program that reads the index may lack it."""
        return _restored, (dumps(self.record), self.source, self.name)


class _UnknownRecord(types.Type):  # type: ignore[misc]
    """The type of a record whose class this program lacks; equal to no other type."""


def _restored(record: bytes, source: str, name: str) -> Any:
    try:
        return RecordType(pickle.loads(record), source)
    except (ImportError, AttributeError):
        return _UnknownRecord(name=f"Unknown.{name}")


def _files_of(record: Any) -> set[str]:
    """Return the files, with hashes, outside this package that define a record's classes.

    Numba names a class without its module, and the kernels that the class selects may have
    changed with the file.
    """
    found: set[str] = set()
    if isinstance(record, types.BaseTuple):
        found.update(*map(_files_of, record.types))
    if isinstance(record, types.BaseNamedTuple):
        module = record.instance_class.__module__
        file = getattr(sys.modules.get(module), "__file__", None)
        if file and not module.startswith("renderer."):
            found.add(f"{module} {file_digest(file)}")
    return found


@register_model(RecordType)
class _RecordModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: RecordType) -> None:
        super().__init__(dmm, fe_type, _POINTER)


class Packed:
    """A record as kernels see it; it keeps the arrays alive."""

    def __init__(self, record: Any, source: str = "") -> None:
        self.record = record
        self.numba_type = record_type(record, source)
        self._memory = np.zeros(self.numba_type.words + 1, np.uint64)
        self._columns: list[Any] = []  # tables that had to be copied to column-major order
        _fill(self._memory, 0, record, self.numba_type.record, self._columns)
        self.address = int(self._memory.ctypes.data)


def pack(record: Any, source: str = "") -> Packed:
    """Return a packed NamedTuple for kernels; its arrays must be C-ordered.

    The fields that its class declares by `table_columns` are column-major instead.

    Arrays are shared, so later changes to them are seen. Numbers are copied.
    """
    return Packed(record, source)


def record_type(record: Any, source: str = "") -> RecordType:
    """Return the Numba type that `pack(record, source)` would have."""
    key = _form(record), source
    if key not in _KNOWN:  # making a type per render was half of the fixed time of a render
        _KNOWN[key] = RecordType(_type_of(record), source)
    return _KNOWN[key]


def record_class(numba_type: Any) -> type | None:
    """Return the NamedTuple class behind a Numba type, None for any other type.

    Functions selected by record (`interface`) compare with this. A tuple of equal array
    types is a `NamedUniTuple`, so test the common base.
    """
    if isinstance(numba_type, RecordType):
        numba_type = numba_type.record
    if isinstance(numba_type, types.BaseNamedTuple):
        return numba_type.instance_class
    return None


# -------------------------------------------------------------------------- from Python

_KNOWN: dict[Any, RecordType] = {}  # by form and source


def _form(value: Any) -> Any:
    """Return a hashable key of all that the type of a value depends on."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.c_contiguous
    if isinstance(value, Packed):
        return value.numba_type
    if isinstance(value, tuple):
        return type(value), *map(_form, value)
    return type(value)


def _type_of(value: Any) -> Any:
    """Return the type of a leaf or record; it does not depend on an array's shape."""
    match value:
        case None:
            return types.none
        case np.ndarray():
            if not value.flags.c_contiguous:
                raise TypeError(f"an array of shape {value.shape} is not C-ordered")
            return types.Array(from_dtype(value.dtype), value.ndim, "C")
        case Packed():
            return value.numba_type
        case tuple():
            columns = column_fields(type(value))
            names = getattr(value, "_fields", range(len(value)))
            parts = [
                types.Array(from_dtype(part.dtype), 2, "F")
                if name in columns
                else _type_of(part)
                for name, part in zip(names, value, strict=True)
            ]
            same = len(parts) > 0 and all(part == parts[0] for part in parts)
            if same:
                return types.NamedUniTuple(parts[0], len(parts), type(value))
            return types.NamedTuple(parts, type(value))
        case float() | np.float64():
            return types.float64
        case np.generic():
            return from_dtype(value.dtype)
        case bool() | int():
            return types.int64
    raise TypeError(f"a kernel's record cannot hold a {type(value).__name__}")


_CLASSES = (types.NoneType, types.Array, types.BaseTuple, RecordType)
_CLASS_OF: dict[type, type | None] = {}


def _class_of(numba_type: Any) -> type | None:
    """Return which of these classes a type belongs to, None for numbers.

    Cached by the type's class: `isinstance` goes through the abstract base classes of
    Numba's types, which was half of the time of packing a record.
    """
    cls = type(numba_type)
    if cls not in _CLASS_OF:
        _CLASS_OF[cls] = next((c for c in _CLASSES if issubclass(cls, c)), None)
    return _CLASS_OF[cls]


def _words(numba_type: Any) -> int:
    cls = _class_of(numba_type)
    if cls is types.NoneType:
        return 0
    if cls is types.Array:
        return 1 + int(numba_type.ndim)
    if cls is types.BaseTuple:
        return sum(_words(part) for part in numba_type.types)
    return 1


def _fill(memory: Any, at: int, value: Any, numba_type: Any, columns: list[Any]) -> int:
    """Write a value at word `at`; return the next free word.

    Tables that had to be copied to column-major order are appended to `columns`.
    """
    cls = _class_of(numba_type)
    if cls is types.NoneType:
        return at
    if cls is types.Array:
        if numba_type.layout == "F" and not lies_by_columns(value):
            value = by_columns(value)
            columns.append(value)
        memory[at] = value.ctypes.data
        memory[at + 1 : at + 1 + value.ndim] = value.shape
        return at + 1 + int(value.ndim)
    if cls is types.BaseTuple:
        for part, part_type in zip(value, numba_type.types, strict=True):
            at = _fill(memory, at, part, part_type, columns)
        return at
    if cls is RecordType:
        memory[at] = value.address
    else:
        memory[at : at + 1].view(as_dtype(numba_type))[0] = value
    return at + 1


@typeof_impl.register(Packed)
def _typeof_packed(value: Packed, context: Any) -> RecordType:
    return value.numba_type


@unbox(RecordType)
def _unbox_packed(numba_type: Any, packed: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(packed, "address")
    number = c.pyapi.long_as_longlong(address)
    c.pyapi.decref(address)
    return NativeValue(c.builder.inttoptr(number, _POINTER))


# ----------------------------------------------------------------------- inside kernels

_LAYOUTS: dict[Any, dict[str, tuple[Any, int]]] = {}


def _layout(record: Any) -> dict[str, tuple[Any, int]]:
    """Return name -> (type, word) of the fields."""
    if record not in _LAYOUTS:
        at, fields = 0, {}
        for name, part in zip(record.instance_class._fields, record.types, strict=True):
            fields[name] = (part, at)
            at += _words(part)
        _LAYOUTS[record] = fields
    return _LAYOUTS[record]


def _holds_users(record: Any) -> bool:
    """Return whether a record, or a nested one, has a class outside of this package."""
    if not record.instance_class.__module__.startswith("renderer."):
        return True
    parts = (part for part in record.types if isinstance(part, types.BaseNamedTuple))
    return any(map(_holds_users, parts))


@infer_getattr
class _Attributes(AttributeTemplate):  # type: ignore[misc]
    key = RecordType

    def generic_resolve(self, numba_type: RecordType, name: str) -> Any:
        field = _layout(numba_type.record).get(name)
        if field is None:
            return None
        part = field[0]
        if not isinstance(part, types.BaseNamedTuple):
            return part
        # an older version of the class may have the same name
        return RecordType(part, numba_type.source if _holds_users(part) else "")


def _load(builder: Any, base: Any, word: int, llvm_type: Any) -> Any:
    """Load a leaf as invariant, so that LLVM may move the load out of loops."""
    place = builder.gep(base, [_I64(_WORD * word)], inbounds=True)
    value = builder.load(builder.bitcast(place, llvm_type.as_pointer()))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


@lower_getattr_generic(RecordType)
def _get_attribute(
    context: Any, builder: Any, numba_type: Any, pointer: Any, name: str
) -> Any:
    part, at = _layout(numba_type.record)[name]
    if isinstance(part, types.NoneType):
        return context.get_dummy_value()
    if isinstance(part, types.BaseNamedTuple):
        return builder.gep(pointer, [_I64(_WORD * at)], inbounds=True)
    if isinstance(part, types.Array):
        return _array(context, builder, part, pointer, at)
    return _load(builder, pointer, at, context.get_value_type(part))


def _array(context: Any, builder: Any, part: Any, pointer: Any, at: int) -> Any:
    """Return the array whose pointer and shape are stored from word `at` on."""
    item = context.get_data_type(part.dtype)
    bytes_each = context.get_abi_sizeof(item)
    array = make_array(part)(context, builder)
    array.data = _load(builder, pointer, at, item.as_pointer())
    shape = [_load(builder, pointer, at + 1 + k, _I64) for k in range(part.ndim)]
    strides, size = [], _I64(bytes_each)
    for length in reversed(shape) if part.layout == "C" else shape:
        strides.append(size)
        size = builder.mul(size, length, flags=["nsw"])
    if part.layout == "C":
        strides.reverse()
    array.shape = cgutils.pack_array(builder, shape)
    array.strides = cgutils.pack_array(builder, strides)
    array.itemsize = _I64(bytes_each)
    array.nitems = builder.sdiv(size, _I64(bytes_each))
    array.meminfo = ir.Constant(array.meminfo.type, None)
    array.parent = ir.Constant(array.parent.type, None)
    return array._getvalue()
