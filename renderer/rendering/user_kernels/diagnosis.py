"""From what Numba raises about a user's kernel to one line: place, what is wrong, remedy.

A rule looks at one class of mistakes and returns what to say, or nothing. What no rule
knows is said in the words of Numba's message that name the cause.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
from typing import Any

from renderer.errors import PluginError, did_you_mean
from renderer.kinds.bsdfs.kind import Branch, BsdfSample, Numbers
from renderer.rendering.user_kernels.mistake import Mistake
from renderer.rendering.user_kernels.remedies import (
    COMPARISONS,
    MODULES,
    SYMBOLS,
    VECTORS,
    instead_of,
)
from renderer.rendering.user_kernels.statements import names_in, resolve
from renderer.rendering.user_kernels.words import (
    arguments_of,
    core_of,
    in_words,
    joined_words,
)

_FIELD = re.compile(r"Unknown attribute '(\w+)' of type (.+)")


def explain(error: BaseException, kernel: Any) -> PluginError:
    """Return what a failed compilation of a user's kernel means to its author.

    Parameters
    ----------
    error
        Numba's, or whatever else was raised while it compiled.
    kernel
        What was compiled; the mistake may be in another one that it calls.
    """
    if isinstance(error, PluginError):
        return error
    found = Mistake(error, kernel)
    for rule in _RULES:
        if what := rule(found):
            break
    else:
        what = core_of(found.text) or type(error).__name__
    return PluginError(f"{found.name}: {what}", found.place)


# ------------------------------------------------------------------------------- rules


def _condition(found: Mistake) -> str:
    """Look for `if`, `and`, `not`, ...: they ask for one truth value of sixteen."""
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


def _call(found: Mistake) -> str:
    """Look for functions of Python, `math` or NumPy, and operators, that lanes lack."""
    function, name, arguments = found.call_without_meaning()
    if not name:
        return ""
    if function.startswith("<intrinsic"):
        return _of_the_lanes(found, arguments)
    if name.startswith(("float", "int", "uint")) and "Lanes(" in arguments:
        return f"{name}() of {joined_words(arguments)}: {instead_of(name)}"
    words = joined_words(arguments)
    symbol = SYMBOLS.get(name)
    is_operator = symbol is not None and "builtin" in function.replace(
        "built-in", "builtin"
    )
    if is_operator and not _is_called(found, name):
        return _operator(name, str(symbol), arguments, found)
    if said := re.search(r"TypingError: (\w+ exists for .+?, not for )(.+)", found.text):
        return f"{said[1]}{joined_words(said[2])}"
    if name == "vec3" and "vec3" in function:
        return f"vec3 takes three numbers or lanes, not {words}"
    remedy = instead_of(name)
    return f"{name}() of {words}: {remedy or 'it has no meaning in a kernel'}"


def _is_called(found: Mistake, name: str) -> bool:
    """Return whether the line has a call by this name, as `pow(x, 2)` and not `x ** 2`."""
    names = (
        getattr(c.func, "id", getattr(c.func, "attr", "")) for c in found.has(ast.Call)
    )
    return name in names


def _of_the_lanes(found: Mistake, arguments: str) -> str:
    """Quote a function of `lanes.functions`, which says what it cannot do."""
    after = found.text[found.text.index("No implementation of function") :]
    said = re.search(r"TypingError: (.+)", after)
    what = in_words(said[1]) if said else f"it does not take {joined_words(arguments)}"
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
        cls = _class_called(sides[0].partition("(")[0], found)
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
            f"{said}: both sides must be masks; comparisons beside {symbol} need "
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


def _field(found: Mistake) -> str:
    match = _FIELD.search(found.text)
    if match is None:
        return ""
    name, numba_type = match[1], match[2].strip()
    called = found.called_kernel()
    if called and not any(name == node.attr for node in found.has(ast.Attribute)):
        return f"{called} is given {in_words(numba_type)}, which has no .{name}"
    if numba_type.startswith("Vec3("):
        remedy = {"r": "x", "g": "y", "b": "z"}.get(name, "")
        known = _names_in_lanes()
        if name in known:
            remedy = f"the function {name}({_parameters_of(known[name])}) ({VECTORS})"
        return f"a vector has no .{name}; it has x, y and z" + (
            f"; use {remedy}" if remedy else ""
        )
    if numba_type.startswith("Module("):
        module = re.search(r"<module '([\w.]+)'", numba_type)
        known_names = dir(sys.modules.get(module[1])) if module else []
        owner = module[1] if module else numba_type
        return f"{owner} has no {name}{did_you_mean(name, known_names)}"
    cls = _class_called(numba_type.partition("(")[0], found)
    if cls is not None:
        fields = cls._fields
        return (
            f"{cls.__name__} has no field {name!r}; it has {', '.join(fields)}"
            f"{did_you_mean(name, fields)}"
        )
    remedy = instead_of(name)
    return f"{in_words(numba_type)} cannot be asked for .{name}" + (
        f"; {remedy}" if remedy else ""
    )


def _class_called(name: str, found: Mistake) -> Any:
    """Return the NamedTuple class of a name, ours or the user's."""
    known = [Numbers, BsdfSample, Branch, *names_in(found.kernel.py_func).values()]
    known += names_in(found.function).values()
    for cls in known:
        if getattr(cls, "__name__", "") == name and hasattr(cls, "_fields"):
            return cls
    return None


def _unknown_name(found: Mistake) -> str:
    match = re.search(r"NameError: name '(\w+)' is not defined", found.text)
    if match is not None:
        name, lanes = match[1], _names_in_lanes()
        if name in lanes:
            owner = next(m for m in MODULES if hasattr(importlib.import_module(m), name))
            return f"{name} is not defined; write at the top: from {owner} import {name}"
        known = [*found.function.__code__.co_varnames, *found.function.__globals__, *lanes]
        return f"{name} is not defined{did_you_mean(name, known)}"
    match = re.search(r"Variable '(\w+)' is not defined", found.text)
    if match is not None:
        return f"{match[1]} is used before it has a value"
    match = re.search(r"module '([\w.]+)' has no attribute '(\w+)'", found.text)
    if match is not None:
        known = dir(sys.modules.get(match[1]))
        return f"{match[1]} has no {match[2]}{did_you_mean(match[2], known)}"
    return ""


def _outer_name(found: Mistake) -> str:
    match = re.search(
        r"Untyped (?:global|freevar) name '(.+?)':.*?<(?:class|type) '([\w.]+)'", found.text
    )
    if match is None:
        match = re.search(r"The use of a reflected (list).*?variable '(.+?)'", found.text)
        if match is None:
            return ""
        name, kind = match[2], "list"
    else:
        name, kind = match[1], match[2]
    if kind.startswith("builtin_"):
        return f"{name}(): {instead_of(name) or 'it has no meaning in a kernel'}"
    if kind == "function":
        return f"{name} is no kernel; decorate it with renderer.kernel"
    return f"{name} is a {kind}; a kernel can use numbers, tuples, arrays and other kernels"


def _arguments(found: Mistake) -> str:
    """Look for a call with too few, too many or unknown arguments."""
    said = re.search(
        r"(missing a required .*|too many (?:positional|keyword) .*|"
        r"got an unexpected keyword .*|multiple values for .*|missing \d+ required .*|"
        r"takes .*positional arguments?.*)",
        found.text,
    )
    if said is None or found.call_without_meaning()[1]:
        return ""
    what = said[1].rstrip("\".'") + ("'" if said[1].rstrip('".').endswith("'") else "")
    for node in found.has(ast.Call):
        called = resolve(node.func, found.function)
        names = [word.arg for word in node.keywords if word.arg]
        try:
            signature = _signature_of(called)
        except (TypeError, ValueError):
            continue
        try:
            signature.bind(*node.args, **dict.fromkeys(names))
        except TypeError:
            name = getattr(called, "__name__", ast.unparse(node.func))
            wrong = next((n for n in names if n not in signature.parameters), "")
            if wrong:
                what = f"it has no {wrong!r}{did_you_mean(wrong, signature.parameters)}"
            return f"{name}({', '.join(signature.parameters)}): {what}"
    return f"a call has the wrong arguments: {what}"


def _signature_of(called: Any) -> inspect.Signature:
    """Return the parameters of a kernel, an interface, an intrinsic or a class.

    Raises
    ------
    ValueError
        If they are not known.
    """
    if hasattr(called, "_defn"):  # of an intrinsic; the first is Numba's own
        signature = inspect.signature(called._defn)
        return signature.replace(parameters=list(signature.parameters.values())[1:])
    if called is None:
        raise ValueError
    return inspect.signature(getattr(called, "py_func", called))


def _parameters_of(called: Any) -> str:
    try:
        return ", ".join(_signature_of(called).parameters)
    except (TypeError, ValueError):
        return ""


def _branches(found: Mistake) -> str:
    """Look for a name, or a result, that has two types."""
    if "Can't unify return type" in found.text:
        returned = re.findall(
            r"Return of: .*?, type '(.+)', location:\s+File .*?, line (\d+)", found.text
        )
        ways = [f"{in_words(t)} in line {n}" for t, n in sorted(returned, key=_line_of)]
        return f"it returns {' and '.join(ways) or 'different types'}; one type is needed"
    match = re.search(r"Cannot unify (.+?) and (.+?) for '([\w$]+)", found.text)
    if match is None:
        return ""
    name = match[3].partition(".")[0]
    words = f"{in_words(match[1])} and {in_words(match[2])}"
    remedy = (
        "; begin with lanes, such as splat_f32(0.0)"
        if "Lanes(" in match[0] and "Vec3(" not in match[0]
        else "; give it one type"
    )
    return f"{name} is {words} in different places{remedy}"


def _line_of(returned: tuple[str, str]) -> int:
    return int(returned[1])


def _unpacking(found: Mistake) -> str:
    match = re.search(r"failed to unpack (.+)", found.text)
    if match is not None:
        words = in_words(match[1])
        remedy = "; take .x, .y and .z" if "Vec3(" in match[1] else ""
        return f"{words} cannot be unpacked{remedy}"
    match = re.search(r"wrong tuple length.*expected (\d+), got (\d+)", found.text)
    if match is not None:
        return f"{match[1]} names are given {match[2]} values"
    return ""


def _others(found: Mistake) -> str:
    text = found.text
    if "runaway recursion" in text:
        return "a kernel cannot call itself; use a loop"
    if "No definition for lowering" in text and " = " in text:
        return "a field cannot be set; make a new vector, such as vec3(x, y, z)"
    if "NRT required" in text:
        return "a kernel makes no lists, sets, dictionaries or arrays; use tuples"
    match = re.search(r"Invalid use of (.+?) with parameters", text)
    if match is not None and match[1] == "getiter":
        return "a kernel loops over range(n), n a whole number that all lanes share"
    if match is not None:
        return f"{in_words(match[1])} cannot be called; a product is written a * b"
    match = re.search(r"unsupported opcode \((\w+)\)", text)
    if match is not None:
        return f"a kernel cannot have this statement of Python's ({match[1]})"
    return ""


_RULES = (
    _condition,
    _field,
    _unknown_name,
    _outer_name,
    _call,
    _branches,
    _arguments,
    _unpacking,
    _others,
)


def _names_in_lanes() -> dict[str, Any]:
    """Return the functions that kernels have on lanes and vectors, by name."""
    return {
        name: value
        for module in MODULES
        for name, value in vars(importlib.import_module(module)).items()
        if not name.startswith("_") and callable(value) and name.islower()
    }
