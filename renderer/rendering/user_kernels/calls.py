"""Calls and operators that lanes, vectors and masks do not support, and alternatives."""

from __future__ import annotations

import ast
import re
from typing import Any

from renderer.rendering.user_kernels.mistake import (
    Mistake,
    arguments_of,
    in_words,
    joined_words,
)
from renderer.rendering.user_kernels.remedies import (
    COMPARISONS,
    SYMBOLS,
    VECTORS,
    instead_of,
)


def without_truth(found: Mistake) -> str:
    """Detect `if`, `and`, `not`, ...: lanes have sixteen truth values, not one."""
    _, name, arguments = found.call_without_meaning()
    lanes = "Mask(" in arguments or "Lanes(" in arguments
    if name not in ("bool", "truth", "not_") or not lanes:
        return ""
    said = []
    for node in found.has(ast.BoolOp):
        word, symbol = ("and", "&") if isinstance(node.op, ast.And) else ("or", "|")
        said.append(f"`{word}` of 16 lanes: use (a) {symbol} (b), in parentheses")
    if any(isinstance(node.op, ast.Not) for node in found.has(ast.UnaryOp)):
        said.append("`not` of 16 lanes: use ~(a)")
    if any(len(node.ops) > 1 for node in found.has(ast.Compare)):
        said.append("`a < x < b` of 16 lanes: use (a < x) & (x < b)")
    if not said:
        loop = any(_in_test(found, node) for node in found.has(ast.While))
        word = "while" if loop else "if"
        said.append(
            f"`{word}` on 16 lanes: use select(mask, yes, no), which takes both sides"
            + (", in a loop of a fixed length" if loop else "")
        )
    return "; ".join(dict.fromkeys(said))


def _in_test(found: Mistake, node: Any) -> bool:
    line = int(found.place.rpartition(":")[2])
    return bool(node.test.lineno <= line <= node.test.end_lineno)


def without_meaning(found: Mistake) -> str:
    """Detect functions of Python, `math` or NumPy, and operators, that lanes lack."""
    function, name, arguments = found.call_without_meaning()
    if not name:
        return ""
    if function.startswith("<intrinsic"):
        return _of_the_lanes(found, arguments)
    if name.startswith(("float", "int", "uint")) and "Lanes(" in arguments:
        return f"{name}() of {joined_words(arguments)}: {instead_of(name)}"
    words = joined_words(arguments)
    symbol = SYMBOLS.get(name)
    is_operator = symbol is not None and "built-in" in function
    if is_operator and not _is_called(found, name):
        return _operator(name, str(symbol), arguments, found)
    if said := re.search(r"TypingError: (\w+ exists for .+?, not for )(.+)", found.text):
        return f"{said[1]}{joined_words(said[2])}"
    if name == "vec3" and "vec3" in function:
        return f"vec3 takes three numbers or lanes, not {words}"
    remedy = instead_of(name)
    return f"{name}() of {words}: {remedy or 'it has no meaning in a kernel'}"


def _is_called(found: Mistake, name: str) -> bool:
    """Return whether the line has a call with this name: `pow(x, 2)`, but not `x ** 2`."""
    called = [call.func for call in found.has(ast.Call)]
    return name in [getattr(c, "id", getattr(c, "attr", "")) for c in called]


def _of_the_lanes(found: Mistake, arguments: str) -> str:
    """Return the message of `lanes.functions` for arguments that it does not support."""
    after = found.text[found.text.index("No implementation of function") :]
    said = re.search(r"TypingError: (.+)", after)
    what = in_words(said[1]) if said else f"it does not take {joined_words(arguments)}"
    if what.startswith("cannot make") and arguments.startswith("Lanes("):
        return f"{what}; it is lanes already"
    if "Vec3(" in arguments and "select" in what:
        return f"{what}; of vectors use select3(mask, a, b) ({VECTORS})"
    if "Vec3(" in arguments:
        return f"{what}; take the components, such as v.x"
    if "select cannot mix" in what and "Mask(" in arguments.partition(",")[2]:
        return f"{what}; use masks for both, or & and |"
    if "under one truth value" in what:
        return f"{what}; the condition must be a mask, as of comparing lanes"
    if "select needs a mask" in what:
        return f"{what}; compare, as in select(x > 0.0, yes, no)"
    if "needs floats" in what or "splat" in what:
        return f"{what}; write 2.0 in the place of 2, or to_f32(x) of lanes"
    return what


def _operator(name: str, symbol: str, arguments: str, found: Mistake) -> str:
    said = f"`{symbol}` of {joined_words(arguments)}"
    sides = arguments_of(arguments)
    if symbol in ("[]", "[] ="):
        if sides[0].startswith("Vec3("):
            return f"{said}: a vector has the components .x, .y and .z"
        if sides[0].startswith("Lanes("):
            return f"{said}: lanes are computed on together, and have no index"
        if "array(" in sides[0] and "Lanes(" in arguments:
            return f"{said}: use gather_row (renderer.kernels.lanes.memory)"
        cls = found.class_called(sides[0].partition("(")[0])
        if cls is not None:
            return f"{said}: its fields are .{', .'.join(cls._fields)}"
        return f"{said}: it has no meaning in a kernel"
    if "Mask(" in arguments:
        if symbol in ("&", "|", "^"):
            return f"{said}: both sides must be masks; splat_mask(True) makes one"
        if arguments.count("Mask(") > 1:
            return f"{said}: masks are joined by &, | and ~"
        return f"{said}: a mask is no number; use select(mask, x, 0.0)"
    if symbol in ("&", "|"):
        return (
            f"{said}: both sides must be masks; comparisons next to {symbol} need "
            "parentheses, as in (a > 0.0) & (b > 0.0)"
        )
    if "Tuple(" in arguments:
        return f"{said}: take the parts, as in sine, cosine = sincos(x)"
    if "none" in arguments:
        return f"{said}: None is no number"
    if "str]" in arguments or "unicode" in arguments:
        return f"{said}: a text is no number"
    if "Vec3(" in arguments and symbol in COMPARISONS:
        return f"{said}: compare components, such as v.z > 0.0"
    if name.startswith("i") and symbol.endswith("=") and "Vec3(" in arguments:
        return f"{said}: write a = a {symbol[:-1]} b"
    if "float64 x" in arguments:
        return f"{said}: of two precisions; convert by to_single(x) or to_double(x)"
    if re.search(r"Lanes\(u?int", arguments):
        return f"{said}: convert whole numbers by to_f32(x), or compute with whole ones"
    remedy = instead_of(name)
    return f"{said}: {remedy or 'it has no meaning in a kernel'}"
