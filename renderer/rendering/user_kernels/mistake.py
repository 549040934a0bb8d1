"""`Mistake`: an error of Numba in a user's kernel, with its place and plain words.

Numba's names of types and its messages are replaced by the terms of the tutorial.
"""

from __future__ import annotations

import ast
import inspect
import operator
import os
import re
import sys
import traceback
from typing import Any

from numba.core.ir import Loc

from renderer.plugins.bsdfs.kind import Branch, BsdfSample, Numbers
from renderer.process.source_places import definition_of, is_users_file, shown_place
from renderer.rendering.user_kernels.statements import names_in, tree_of

_NUMBER = r"(?:float|u?int)(?:8|16|32|64)"
# applied in this order: inner types before the vectors and tuples that contain them
_WORDS = (
    (r"Record\.(\w+)\.\w+", r"\1"),
    (r"Function\(<class '(\w+)'>\)", r"\1"),
    (r"(?:readonly )?array\(([^()]*)\)", "an array"),
    (r"Literal\[str\]\((.*?)\)", r"the text '\1'"),
    (r"Literal\[bool\]\((\w+)\)", r"\1"),
    (r"Literal\[int\]\((-?\d+)\)", r"the number \1"),
    (r"Vec3\(Lanes\(float32 x 16\)\)", "a vector of 16 lanes"),
    (r"Vec3\(Lanes\((\w+) x (\d+)\)\)", r"a vector of \2 lanes of \1"),
    (r"Vec3\((\w+)\)", r"a vector of one \1"),
    (r"Lanes\(float32 x 16\)", "16 lanes"),
    (r"Lanes\((\w+) x (\d+)\)", r"\2 lanes of \1"),
    (r"Mask\(16\)", "a mask of 16 lanes"),
    (rf"(?<!lanes of )(?<!of one )\b({_NUMBER})\b(?! x)", r"one number (\1)"),
    (r"\bunicode_type\b", "a text"),
    (r"\bnone\b", "None"),
    (r"\bbool\b", "one truth value"),
    (r"\bOptionalType\((.*)\)", r"\1 or None"),
    (r"\bUniTuple\((.*) x (\d+)\)", r"a tuple of \2: \1"),
    (r"\bTuple\((.*)\)", r"a tuple of \1"),
    (r"type\(CPUDispatcher\(<function (\w+) at 0x\w+>\)\)", r"the kernel \1"),
    (r"<(?:built-in )?function (\w+)(?: at 0x\w+)?>", r"\1"),
)


def in_words(text: Any) -> str:
    """Return a message or a type name of Numba in plain words."""
    said = str(text)
    for pattern, words in _WORDS:
        said = re.sub(pattern, words, said)
    return said


def arguments_of(text: str) -> list[str]:
    """Return the arguments in "a, f(b, c)" as a list."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


_OURS = "Lanes|Vec3|Mask|Literal|UniTuple|Tuple|Optional|OptionalType|Function|Record"
_CLASS = re.compile(rf"^(?!(?:{_OURS})\b)([A-Z]\w*)\(.*\)$")  # a NamedTuple's fields


def joined_words(text: str) -> str:
    """Return the types of some arguments in plain words, with "and" before the last."""
    words = [in_words(_CLASS.sub(r"\1", part)) for part in arguments_of(text)]
    if len(words) < 2:
        return "".join(words) or "nothing"
    return f"{', '.join(words[:-1])} and {words[-1]}"


_NOISE = re.compile(
    r"Failed in .* pipeline|- Resolution failure|None$|During: |File |There are \d|"
    r"The compiler failed to analyze the bytecode\.$"
)


def core_of(text: str, most: int = 240) -> str:
    """Return the first line of a message that names the cause, in plain words."""
    lines = (line.strip() for line in text.splitlines())
    said = next((line for line in lines if line and not _NOISE.match(line)), "")
    said = re.sub(r"\. Raised from .*$| at 0x[0-9a-f]+", "", said)
    said = " ".join(in_words(said).split()).rstrip(". ")
    return said if len(said) <= most else said[: most - 3] + "..."


# ------------------------------------------------------------------------------ mistake
# An error in a user's kernel: its place, and the code there.
#
# Numba's message quotes what it was compiling, from the innermost call outwards. The first
# place in a file of the user is the error: inner places are in the renderer or in Numba,
# called with wrong arguments. Some errors have no place in the message; it is then in the
# traceback, in the statement that was being compiled.

_PLACES = re.compile(
    r"\b(?:at|from) (\S.*?\.py|<[^>]+>) \((\d+)\)|File \"(.+?)\", line (\d+):"
)
_NO_MEANING = re.compile(
    r"No implementation of function Function\((.*)\) found for signature:\s+>>> (.+?)\n"
)


class Mistake:
    """A compilation error with its place in the user's file.

    Parameters
    ----------
    error
        Raised by Numba, or by anything else during compilation.
    kernel
        The kernel that was compiled; the error may be in another one that it calls.

    Attributes
    ----------
    text : str
        The message.
    place : str
        "FILE:LINE" in the user's file.
    function, name
        The function with the error; the compiled kernel if it is unknown.
    nodes : list
        The nodes of its syntax tree in that line.
    """

    def __init__(self, error: BaseException, kernel: Any) -> None:
        self.error, self.kernel = error, kernel
        self.nodes: list[ast.AST] = []
        self._at = 0  # position in the message where the place is named
        self.text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))  # Numba may colour it
        self.function = kernel.py_func
        self.name = self.function.__name__
        filename, line = self._find_place()
        if not filename:
            self.place = definition_of(kernel)
            return
        self.place = shown_place(filename, line)
        self._look_around(filename, line)

    def _find_place(self) -> tuple[str, int]:
        places = [
            (match[1] or os.path.abspath(match[3]), int(match[2] or match[4]), match)
            for match in _PLACES.finditer(self.text)
        ]
        if "Can't unify return type" in self.text:  # these places are in random order
            places.sort(key=operator.itemgetter(1))
        for filename, line, match in places:
            if self._is_ours_to_name(filename):
                self._at = match.start()
                return filename, line
        inner = [getattr(self.error, "loc", None)]
        for frame, _ in traceback.walk_tb(self.error.__traceback__):
            inner.append(getattr(frame.f_locals.get("self"), "loc", None))
        for loc in reversed(inner):
            if isinstance(loc, Loc) and self._is_ours_to_name(loc.filename):
                return loc.filename, int(loc.line)
        return "", 0

    def _is_ours_to_name(self, filename: str) -> bool:
        return filename == self.function.__code__.co_filename or is_users_file(filename)

    def _look_around(self, filename: str, line: int) -> None:
        """Find the function that contains a line, and its syntax nodes there."""
        tree: ast.AST | None = tree_of(self.function)
        if not _is_in(self.function, filename, line):
            outer = [
                *vars(_module_of(filename)).values(),
                *names_in(self.function).values(),
            ]
            known = [getattr(value, "py_func", value) for value in outer]
            inside = [
                f for f in known if inspect.isfunction(f) and _is_in(f, filename, line)
            ]
            if inside:  # the innermost one
                self.function = max(inside, key=lambda f: f.__code__.co_firstlineno)
                self.name, tree = self.function.__name__, tree_of(self.function)
        if tree is not None:
            within: list[Any] = [n for n in ast.walk(tree) if hasattr(n, "end_lineno")]
            self.nodes = [n for n in within if n.lineno <= line <= (n.end_lineno or 0)]

    def has(self, *kinds: type[ast.AST]) -> list[Any]:
        """Return the nodes of some types."""
        return [node for node in self.nodes if isinstance(node, kinds)]

    def call_without_meaning(self) -> tuple[str, str, str]:
        """Return (function, name, arguments) of the call that Numba could not resolve."""
        matches = list(_NO_MEANING.finditer(self.text))
        if not matches:
            return "", "", ""
        # messages quoted within a message, such as those of overloads, are indented
        depth = self._depth(self._at)
        before = [m for m in matches if m.start() < self._at]
        level = [m for m in before if self._depth(m.start()) == depth]
        match = (level or matches[:1])[-1]
        name, _, arguments = match[2].partition("(")
        if name.startswith("<unknown"):
            name = match[1]
        return match[1], name.strip(), arguments.rstrip().removesuffix(")")

    def class_called(self, name: str) -> Any:
        """Return the NamedTuple class of a name, ours or the user's; None if unknown."""
        known = [Numbers, BsdfSample, Branch, *names_in(self.kernel.py_func).values()]
        known += names_in(self.function).values()
        for cls in known:
            if getattr(cls, "__name__", "") == name and hasattr(cls, "_fields"):
                return cls
        return None

    def called_kernel(self) -> str:
        """Return the kernel that the line calls, if the error is inside of it."""
        before = self.text[: self._at]
        names = re.findall(r"callee type: type\(CPUDispatcher\(<function (\w+)", before)
        return f"the kernel {names[-1]}" if names else ""

    def _depth(self, at: int) -> int:
        """Return the indentation of the line at a position of the message."""
        line = self.text[self.text.rfind("\n", 0, at) + 1 :]
        return len(line) - len(line.lstrip(" "))


def _is_in(function: Any, filename: str, line: int) -> bool:
    code = function.__code__
    if code.co_filename != filename:
        return False
    try:
        lines, first = inspect.getsourcelines(function)
    except (OSError, TypeError):
        return False
    return first <= line < first + len(lines)


def _module_of(filename: str) -> Any:
    for module in list(sys.modules.values()):
        if getattr(module, "__file__", None) == filename:
            return module
    return ast  # a module without functions of the user
