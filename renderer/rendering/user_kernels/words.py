"""Numba's types and messages in the words of the walk-through."""

from __future__ import annotations

import re
from typing import Any

_NUMBER = r"(?:float|u?int)(?:8|16|32|64)"
# in this order: the inner types of a vector or tuple before these
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
    """Return a message of Numba's, or the name of one of its types, in plain words."""
    said = str(text)
    for pattern, words in _WORDS:
        said = re.sub(pattern, words, said)
    return said


def arguments_of(text: str) -> list[str]:
    """Return the arguments in "a, f(b, c)", one by one."""
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
    """Return the types of some arguments in plain words, the last after "and"."""
    words = [in_words(_CLASS.sub(r"\1", part)) for part in arguments_of(text)]
    if len(words) < 2:
        return "".join(words) or "nothing"
    return f"{', '.join(words[:-1])} and {words[-1]}"


_NOISE = re.compile(
    r"Failed in .* pipeline|- Resolution failure|None$|During: |File |There are \d|"
    r"The compiler failed to analyze the bytecode\.$"
)


def core_of(text: str, most: int = 240) -> str:
    """Return the first line of a message that says what is wrong, in plain words."""
    lines = (line.strip() for line in text.splitlines())
    said = next((line for line in lines if line and not _NOISE.match(line)), "")
    said = re.sub(r"\. Raised from .*$| at 0x[0-9a-f]+", "", said)
    said = " ".join(in_words(said).split()).rstrip(". ")
    return said if len(said) <= most else said[: most - 3] + "..."
