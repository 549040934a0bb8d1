"""Compiles each kernel of a user's BSDF separately, and checks its result type.

This is done before the large kernels that call them are compiled, with the same argument
types. So nothing is compiled twice, and an error is reported with a line of the user's
file. The renderer's own kinds are not checked.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any
from weakref import WeakKeyDictionary

from numba.core import types

from renderer.errors import PluginError
from renderer.kernels.jit import record_type
from renderer.kernels.lanes.types import Lanes, Mask, f32x16, i32x16
from renderer.kernels.lanes.vectors import Vec3Type
from renderer.plugins.bsdfs.kind import Branch, BsdfKind, BsdfSample, Color, Numbers
from renderer.plugins.bsdfs.parameters import hints_of
from renderer.plugins.bsdfs.registration import CALLED_WITH
from renderer.plugins.bsdfs.try_out import kernel_with_nan
from renderer.plugins.sampling.numbers_and_warps import along_u
from renderer.process.source_places import definition_of, shown_place
from renderer.rendering.user_kernels.diagnosis import explain
from renderer.rendering.user_kernels.mistake import core_of, in_words
from renderer.rendering.user_kernels.statements import check_statements, tree_of
from renderer.scene.materials import MaterialTables, is_textured, kind_of, value_of

LANES, VECTOR, LOBES = f32x16, Vec3Type(f32x16), i32x16
_BRANCH = (Branch, {"weight": VECTOR, "share": LANES, "cos_t": LANES, "eta": LANES})
# kernel -> class of its result, and the types of the fields
_RETURNS: dict[str, tuple[type, dict[str, Any]]] = {
    "sample": (
        BsdfSample,
        {"wi": VECTOR, "weight": VECTOR, "pdf": LANES, "eta": LANES, "lobe": LOBES},
    ),
    "eval_pdf": (tuple, {"f |cos|": VECTOR, "the density": LANES}),
    "reflection": _BRANCH,
    "transmission": _BRANCH,
    "albedo": (Vec3Type, {}),
}

# kind -> types of arithmetic with which its kernels have passed
_PASSED: WeakKeyDictionary[BsdfKind, set[Any]] = WeakKeyDictionary()


def check_kernels_of_users(kinds: Iterable[BsdfKind], arithmetic: Any) -> None:
    """Check the kernels of all kinds that a user has registered.

    Parameters
    ----------
    kinds
        The kinds of a scene, including nested ones.
    arithmetic
        The record passed to them, see `renderer.plugins.sampling.numbers_and_warps`.

    Raises
    ------
    PluginError
        For the first error: file, line, what is wrong, and an alternative.
    """
    for kind in kinds:
        rounded = along_u(arithmetic) if kind.oriented else arithmetic
        for leaf in _users(kind):
            passed = _PASSED.setdefault(leaf, set())
            if record_type(rounded) not in passed:
                check_kernels_of(leaf, rounded)
                passed.add(record_type(rounded))


def check_values_of_users(materials: MaterialTables) -> None:
    """Refuse a user's BSDF whose kernels return NaN with the parameters of a scene.

    NaN is neither above 0 nor below: the stages would silently drop such light. Nested
    BSDFs are not checked. A textured parameter is replaced by 0.5.

    Raises
    ------
    PluginError
        Names the function that returns NaN.
    """
    constant = materials.values()
    for k, bsdf in enumerate(materials.bsdfs):
        kind = kind_of(bsdf)
        if kind.inside or not kind.users_kernels:
            continue
        values = constant[:, k].copy()
        for name, first, count in kind.layout():
            if is_textured(value_of(bsdf, name)):
                values[first : first + count] = 0.5
        if name := kernel_with_nan(kind, values):
            place = definition_of(dict(kind.users_kernels)[name])
            said = f"{name} of BSDF {kind.name!r} returns NaN: is there a division by 0, or"
            raise PluginError(f"{said} a root of a negative number?", place)


def blame_users(error: Exception, kinds: Iterable[BsdfKind]) -> None:
    """Raise an error that names a scene's user BSDFs, after an exception in a kernel.

    The renderer's own kernels raise nothing. A user's kernel raises if it indexes a tuple
    out of range; compiled code does not know the line.

    Raises
    ------
    PluginError
        If the scene has such BSDFs.
    """
    users = {leaf.name: leaf for kind in kinds for leaf in _users(kind)}
    if users:
        said = f"a kernel of BSDF {' or '.join(map(repr, users))} failed:"
        first = dict(next(iter(users.values())).users_kernels)["sample"]
        what = f"{said} {type(error).__name__}: {core_of(str(error))}"
        raise PluginError(what, definition_of(first)) from error


def _users(kind: BsdfKind) -> list[BsdfKind]:
    """Return the users' kinds in a kind and its nested ones."""
    return [leaf for leaf in kind.leaves if leaf.source]


def check_kernels_of(kind: BsdfKind, arithmetic: Any) -> None:
    """Check the kernels of one kind; see `check_kernels_of_users`."""
    hints = hints_of(kind.parameters).values()
    fields = [VECTOR if hint is Color else LANES for hint in hints]
    numbers = [LANES, LANES, LANES, record_type(arithmetic)]
    given = {
        "parameters": types.BaseTuple.from_types(fields, kind.parameters),
        "numbers": types.BaseTuple.from_types(numbers, Numbers),
        "wo": VECTOR,
        "wi": VECTOR,
    }
    for name, kernel in kind.users_kernels:
        words = CALLED_WITH[name]
        if name == "albedo" and not kind.seen_albedo:
            words = words[:1]
        check_statements(kernel)
        returned = _compiled(kernel, tuple(given[word] for word in words))
        what = what_is_wrong(returned, *_RETURNS[name])
        if not what and name == "sample" and kind.delta and _no_lobe(returned, kind):
            what = (
                -1,
                "returns no lobe, and the BSDF is registered with delta=True; "
                "BsdfSample(wi, weight, pdf, eta, lobe) is needed",
            )
        if what:
            said = f"{name} of BSDF {kind.name!r} {what[1]}"
            raise PluginError(said, _place_of_return(kernel, what[0]))


def _no_lobe(returned: Any, kind: BsdfKind) -> bool:
    """Return whether a sample lacks its lobe although the kind needs it."""
    old_form = {"reflection", "transmission"} & dict(kind.users_kernels).keys()
    return not old_form and returned.types[-1] != LOBES


def _compiled(kernel: Any, signature: tuple[Any, ...]) -> Any:
    """Compile a kernel, or load it from the cache; return its result type."""
    try:
        kernel.compile(signature)
        return kernel.overloads[signature].signature.return_type
    except Exception as error:  # Numba raises many classes of errors, also Python's
        raise explain(error, kernel) from error


# --------------------------------------------------------------- results of a kernel


def what_is_wrong(found: Any, cls: type, fields: dict[str, Any]) -> tuple[int, str] | None:
    """Return the number of the wrong field (-1: all) and the error; None if correct."""
    may_be_left_out = "lobe"
    needed = f"({', '.join(name for name in fields if name != may_be_left_out)})"
    if cls is not tuple:
        needed = cls.__name__ + needed if fields else "a vector (RGB) of 16 lanes"
    if found == types.none:
        return -1, f"returns nothing; {needed} is needed: is there a `return`?"
    if isinstance(found, types.Optional):
        return -1, f"does not return anything on one of its ways; {needed} is needed"
    if not fields:
        what = _unlike(found, VECTOR)
        return (-1, f"returns {what}") if what else None
    named = getattr(found, "instance_class", tuple)
    parts = getattr(found, "types", None) if named is cls else None
    if parts is None or not isinstance(found, types.BaseTuple):
        return -1, f"returns {_short(found)}; {needed} is needed"
    if len(parts) == len(fields) - 1 and may_be_left_out in fields:
        fields = {name: fields[name] for name in fields if name != may_be_left_out}
    if len(parts) != len(fields):
        return -1, f"returns {len(parts)} values; {needed} is needed"
    for k, (name, expected) in enumerate(fields.items()):
        what = _unlike(parts[k], expected)
        if what:
            return k, f"returns as {name} {what}"
    return None


def _unlike(found: Any, expected: Any) -> str:
    """Return how a type differs from the expected one, and the remedy; "" if equal.

    Parameters
    ----------
    expected
        `LANES`, `VECTOR` or `LOBES`.
    """
    if found == expected:
        return ""
    scalar = isinstance(found, types.Number | types.Boolean)
    if expected is LOBES:
        needed = "16 lanes of SMOOTH, DELTA or STRAIGHT are needed"
        remedy = "use splat_i32(DELTA), or select(mask, splat_i32(DELTA), SMOOTH)"
    elif expected is LANES:
        needed = "16 lanes are needed"
        if isinstance(found, Vec3Type):
            remedy = "take one component, such as v.z, or dot(a, b)"
        elif scalar:
            remedy = "use splat_f32(x)"
        else:
            remedy = _converted(found)
    else:
        needed = "a vector of 16 lanes is needed"
        if isinstance(found, Vec3Type) and isinstance(found.element, types.Number):
            remedy = "use vec3(splat_f32(x), splat_f32(y), splat_f32(z))"
        elif isinstance(found, Vec3Type):
            remedy = _converted(found.element)
        elif found == LANES:
            remedy = "use vec3(x, x, x) for a grey"
        elif isinstance(found, types.BaseTuple):
            remedy = "use vec3(x, y, z)"
        elif scalar:
            remedy = "use vec3(splat_f32(x), splat_f32(x), splat_f32(x)) for a grey"
        else:
            remedy = _converted(found)
    return f"{_short(found)}, but {needed}" + (f": {remedy}" if remedy else "")


def _converted(found: Any) -> str:
    if isinstance(found, Mask):
        return "use select(mask, splat_f32(1.0), splat_f32(0.0))"
    if isinstance(found, Lanes) and isinstance(found.element, types.Integer):
        return "use to_f32(x)"
    if isinstance(found, Lanes) and found.element == types.float64:
        return "use to_single(x)"
    return ""


def _short(found: Any) -> str:
    named = getattr(found, "instance_class", None)
    if named is not None:
        return f"{named.__name__}({', '.join(named._fields)})"
    return in_words(found)


def _place_of_return(kernel: Any, number: int) -> str:
    """Return the line of the last `return`, or of its element with this number."""
    function = kernel.py_func
    tree = tree_of(function)
    returns = [n for n in ast.walk(tree) if isinstance(n, ast.Return)] if tree else []
    values = [node.value for node in returns if node.value is not None]
    if not values:
        return definition_of(kernel)
    value: Any = max(values, key=lambda node: node.lineno)
    parts = value.elts if isinstance(value, ast.Tuple) else getattr(value, "args", [])
    line = parts[number].lineno if 0 <= number < len(parts) else value.lineno
    return shown_place(function.__code__.co_filename, line)
