"""Turns Numba's errors in a user's kernel into one line: place, error, remedy.

Each rule detects one class of errors and returns a message, or nothing. If no rule applies,
the message has the part of Numba's message that names the cause.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
from typing import Any

from renderer.errors import PluginError, did_you_mean
from renderer.process.source_places import definition_of
from renderer.rendering.user_kernels.calls import without_meaning, without_truth
from renderer.rendering.user_kernels.mistake import Mistake, core_of, in_words
from renderer.rendering.user_kernels.remedies import MODULES, VECTORS, instead_of
from renderer.rendering.user_kernels.statements import resolve

_FIELD = re.compile(r"Unknown attribute '(\w+)' of type (.+)")


def explain(error: BaseException, kernel: Any) -> PluginError:
    """Return the error of a failed compilation, in terms of the user's kernel.

    Parameters
    ----------
    error
        Raised by Numba, or by anything else during compilation.
    kernel
        The kernel that was compiled; the error may be in another one that it calls.
    """
    if isinstance(error, PluginError):
        return error
    said = core_of(str(error)) or type(error).__name__
    try:
        found = Mistake(error, kernel)
        said = next((what for rule in _RULES if (what := rule(found))), said)
    except Exception:  # a rule may fail for messages of another version of Numba
        return PluginError(f"{kernel.__name__}: {said}", definition_of(kernel))
    return PluginError(f"{found.name}: {said}", found.place)


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
    cls = found.class_called(numba_type.partition("(")[0])
    if cls is not None:
        fields = cls._fields
        return (
            f"{cls.__name__} has no field {name!r}; it has {', '.join(fields)}"
            f"{did_you_mean(name, fields)}"
        )
    remedy = instead_of(name)
    return f"there is no .{name} of {in_words(numba_type)}" + (
        f"; {remedy}" if remedy else ""
    )


def _inside(found: Mistake) -> str:
    """Detect a kernel of the renderer that cannot be compiled for its arguments."""
    called = found.called_kernel()
    if not called:
        return ""
    return (
        f"{called} does not take these arguments; it takes lanes, or vectors of them: "
        "splat_f32(x) makes lanes of a number"
    )


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
    """Detect a call with too few, too many or unknown arguments."""
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
    if called is None:
        raise ValueError
    signature = inspect.signature(getattr(called, "py_func", called))
    parameters = list(signature.parameters.values())
    if parameters and parameters[0].name == "typingctx":  # first parameter of an intrinsic
        return signature.replace(parameters=parameters[1:])
    return signature


def _parameters_of(called: Any) -> str:
    try:
        return ", ".join(_signature_of(called).parameters)
    except (TypeError, ValueError):
        return ""


def _branches(found: Mistake) -> str:
    """Detect a name, or a result, with two types."""
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
    _field,
    _unknown_name,
    _outer_name,
    _arguments,
    _inside,
    without_truth,
    without_meaning,
    _branches,
    _unpacking,
    _others,
)


def _names_in_lanes() -> dict[str, Any]:
    """Return the functions on lanes and vectors, by name."""
    return {
        name: value
        for module in MODULES
        for name, value in vars(importlib.import_module(module)).items()
        if not name.startswith("_") and callable(value) and name.islower()
    }
