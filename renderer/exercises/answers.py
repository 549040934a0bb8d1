"""Answers of functions as plain values: compared, printed, and sent between processes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

CERTAIN = 5.0  # standard deviations between two estimates: 6e-7 of equal ones are farther


class Estimate(NamedTuple):
    """A mean of random numbers, and its standard deviation."""

    mean: float
    error: float


def plain(value: Any) -> Any:
    """Return an answer as None, bool, number, text, list or dictionary of such."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Estimate):
        return {"mean": float(value.mean), "error": float(value.error)}
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, int | float):
        large = abs(value) > 1e300  # an int may be larger than every float
        return math.copysign(math.inf, value) if large else float(value)
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, set | frozenset | range):
        return [plain(one) for one in sorted(value)]
    return {"type": type(value).__name__, "text": repr(value)[:60]}


def raised(error: str, line: int | None) -> dict[str, Any]:
    """Return the answer of a function that raised an exception."""
    return {"raised": error, "line": line}


def is_broken(answer: Any) -> bool:
    """Return whether an answer is an exception, or contains NaN or a complex number."""
    if isinstance(answer, dict):
        return (
            "raised" in answer
            or answer.get("type") == "complex"
            or any(isinstance(one, float) and math.isnan(one) for one in answer.values())
        )
    if isinstance(answer, list):
        return any(is_broken(one) for one in answer)
    return isinstance(answer, float) and math.isnan(answer)


def agree(a: Any, b: Any, tolerance: float) -> bool:
    """Return whether two answers are equal but for rounding; broken ones are alike.

    A right function never gives a broken answer. Which exception or NaN a division by zero
    becomes depends on the type of the numbers, and not on the mistake.
    """
    if is_broken(a) or is_broken(b):
        return is_broken(a) and is_broken(b)
    if isinstance(a, dict) and isinstance(b, dict) and "mean" in a and "mean" in b:
        far = CERTAIN * math.hypot(a["error"], b["error"])
        return abs(a["mean"] - b["mean"]) <= far + tolerance * abs(b["mean"])
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(
            agree(x, y, tolerance) for x, y in zip(a, b, strict=True)
        )
    if isinstance(a, bool | float) and isinstance(b, bool | float):
        return a == b or abs(a - b) <= tolerance * max(abs(a), abs(b), 0.1)
    return bool(a == b)


def distance(a: Any, b: Any) -> float:
    """Return how many standard deviations two estimates are apart; 0 of other answers."""
    if isinstance(a, dict) and isinstance(b, dict) and "mean" in a and "mean" in b:
        error = math.hypot(a["error"], b["error"])
        return abs(a["mean"] - b["mean"]) / error if error > 0.0 else 0.0
    return 0.0


def shown(answer: Any) -> str:
    """Return an answer in words that fit on a line."""
    if answer is None:
        return "None"
    if isinstance(answer, dict):
        if "raised" in answer:
            where = f" in line {answer['line']}" if answer["line"] else ""
            return f"{answer['raised']}{where}"
        if "mean" in answer:
            return f"{answer['mean']:.5g}, standard deviation {answer['error']:.2g}"
        if "type" in answer:
            return f"{answer['text']} (of the type {answer['type']})"
    if isinstance(answer, list):
        texts = [shown(one) for one in answer]
        if len(texts) > 24:
            texts[20:] = [f"... {len(texts)} in all"]
        return f"[{', '.join(texts)}]"
    if isinstance(answer, float):
        return f"{answer + 0.0:.6g}"  # no -0
    return str(answer)


def shown_argument(value: Any) -> str:
    """Return an argument of a function in words; our callables have a `repr` to be read."""
    answer = plain(value)
    if isinstance(answer, dict) and "type" in answer:
        return repr(value)
    return shown(answer)
