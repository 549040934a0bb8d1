"""Replacements in kernels for functions of Python and NumPy on single numbers."""

from __future__ import annotations

FUNCTIONS = "renderer.kernels.lanes.functions"
MATHEMATICS = "renderer.kernels.lanes.mathematics"
VECTORS = "renderer.kernels.lanes.vectors"
MODULES = (FUNCTIONS, VECTORS, MATHEMATICS)

# name in Python, `math` or NumPy -> replacement, and the module that defines it
INSTEAD: dict[str, tuple[str, str]] = {
    "max": ("maximum(a, b)", FUNCTIONS),
    "fmax": ("maximum(a, b)", FUNCTIONS),
    "maximum": ("maximum(a, b)", FUNCTIONS),
    "min": ("minimum(a, b)", FUNCTIONS),
    "fmin": ("minimum(a, b)", FUNCTIONS),
    "minimum": ("minimum(a, b)", FUNCTIONS),
    "clip": ("minimum(maximum(x, low), high)", FUNCTIONS),
    "abs": ("fabs(x)", FUNCTIONS),
    "absolute": ("fabs(x)", FUNCTIONS),
    "fabs": ("fabs(x)", FUNCTIONS),
    "sqrt": ("sqrt(x)", FUNCTIONS),
    "square": ("x * x", ""),
    "cbrt": ("power(x, splat_f32(1.0 / 3.0))", MATHEMATICS),
    "hypot": ("sqrt(a * a + b * b)", FUNCTIONS),
    "floor": ("floor(x)", FUNCTIONS),
    "ceil": ("-floor(-x)", FUNCTIONS),
    "round": ("floor(x + 0.5)", FUNCTIONS),
    "around": ("floor(x + 0.5)", FUNCTIONS),
    "rint": ("floor(x + 0.5)", FUNCTIONS),
    "trunc": ("to_f32(to_i32(x))", FUNCTIONS),
    "fmod": ("x - y * floor(x / y)", FUNCTIONS),
    "mod": ("x - y * floor(x / y)", FUNCTIONS),
    "remainder": ("x - y * floor(x / y)", FUNCTIONS),
    "floordiv": ("floor(x / y)", FUNCTIONS),
    "floor_divide": ("floor(x / y)", FUNCTIONS),
    "divmod": ("floor(x / y)", FUNCTIONS),
    "int": ("to_i32(x)", FUNCTIONS),
    "float": ("x itself, or to_f32(x) of whole numbers", FUNCTIONS),
    "float32": ("x itself, or to_f32(x) of whole numbers", FUNCTIONS),
    "float64": ("to_double(x)", FUNCTIONS),
    "double": ("to_double(x)", FUNCTIONS),
    "where": ("select(mask, yes, no)", FUNCTIONS),
    "sign": ("select(x < 0.0, splat_f32(-1.0), 1.0)", FUNCTIONS),
    "copysign": ("select(y < 0.0, -fabs(x), fabs(x))", FUNCTIONS),
    "logical_and": ("(x > 0.0) & (y > 0.0)", ""),
    "logical_or": ("(x > 0.0) | (y > 0.0)", ""),
    "logical_not": ("~(x > 0.0)", ""),
    "zeros_like": ("splat_f32(0.0)", FUNCTIONS),
    "ones_like": ("splat_f32(1.0)", FUNCTIONS),
    "full_like": ("splat_f32(0.5)", FUNCTIONS),
    "astype": ("to_i32(x), or to_f32(x) of whole numbers", FUNCTIONS),
    "any": ("any_of(mask)", FUNCTIONS),
    "all": ("~any_of(~mask)", FUNCTIONS),
    "isnan": ("x != x", ""),
    "isfinite": ("x - x == 0.0", ""),
    "isinf": ("fabs(x) == math.inf", FUNCTIONS),
    "pow": ("power(x, splat_f32(2.0)), or x * x for a square", MATHEMATICS),
    "power": ("power(x, splat_f32(2.0)), or x * x for a square", MATHEMATICS),
    "float_power": ("power(x, splat_f32(2.0))", MATHEMATICS),
    "exp": ("exp(x)", MATHEMATICS),
    "exp2": ("power(splat_f32(2.0), x)", MATHEMATICS),
    "expm1": ("exp(x) - 1.0", MATHEMATICS),
    "log": ("log(x)", MATHEMATICS),
    "log1p": ("log(1.0 + x)", MATHEMATICS),
    "log2": ("log(x) * 1.442695", MATHEMATICS),
    "log10": ("log(x) * 0.4342945", MATHEMATICS),
    "sin": ("sine, cosine = sincos(x)", MATHEMATICS),
    "cos": ("sine, cosine = sincos(x)", MATHEMATICS),
    "tan": ("sine, cosine = sincos(x), then sine / cosine", MATHEMATICS),
    "atan2": ("arctan2(y, x)", MATHEMATICS),
    "arctan2": ("arctan2(y, x)", MATHEMATICS),
    "atan": ("arctan2(x, splat_f32(1.0))", MATHEMATICS),
    "arctan": ("arctan2(x, splat_f32(1.0))", MATHEMATICS),
    "acos": ("arccos(x)", MATHEMATICS),
    "arccos": ("arccos(x)", MATHEMATICS),
    "asin": ("0.5 * math.pi - arccos(x)", MATHEMATICS),
    "arcsin": ("0.5 * math.pi - arccos(x)", MATHEMATICS),
    "erf": ("erf(x)", MATHEMATICS),
    "sum": ("a + b + c", ""),
    "prod": ("a * b * c", ""),
    "dot": ("dot(a, b)", VECTORS),
    "matmul": ("dot(a, b)", VECTORS),
    "vdot": ("dot(a, b)", VECTORS),
    "inner": ("dot(a, b)", VECTORS),
    "cross": ("cross(a, b)", VECTORS),
    "norm": ("length(a)", VECTORS),
}
# name -> why there is no replacement
IN_VAIN = {
    "range": "a loop runs over a whole number that all lanes share",
    "isinstance": "the types of a kernel are fixed",
    "len": "lanes and vectors have a fixed size",
    "str": "a kernel has no texts",
    "pos": "leave it out",
    "invert": "only a mask, or lanes of whole numbers, can be inverted",
}
IN_VAIN |= dict.fromkeys(
    ("zeros", "ones", "empty", "full", "array", "asarray", "arange", "linspace", "eye"),
    "a kernel makes no arrays; use names, tuples and vec3 for values",
)

# operator -> its symbol
SYMBOLS = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "truediv": "/",
    "floordiv": "//",
    "mod": "%",
    "pow": "**",
    "matmul": "@",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "eq": "==",
    "ne": "!=",
    "and_": "&",
    "or_": "|",
    "xor": "^",
    "lshift": "<<",
    "rshift": ">>",
    "neg": "-",
    "pos": "+",
    "invert": "~",
    "getitem": "[]",
    "setitem": "[] =",
}
SYMBOLS |= {
    f"i{name.rstrip('_')}": f"{SYMBOLS[name]}="
    for name in (
        *("add", "sub", "mul", "truediv", "floordiv", "mod", "pow"),
        *("and_", "or_", "xor", "lshift", "rshift"),
    )
}
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


def instead_of(name: str) -> str:
    """Return the replacement for a function of Python; "" if unknown."""
    if name in IN_VAIN:
        return IN_VAIN[name]
    write, module = INSTEAD.get(name, ("", ""))
    if not write:
        return ""
    return f"use {write}" + (f" ({module})" if module else "")
