"""The versions of Numba whose private parts are known here.

On any other version Numba compiles in its own way: slower, and to the same pictures.
`tests/kernels/test_jit.py` fails on a version that has not been tried.
"""

from __future__ import annotations

import numba

TRIED = ("0.68.1",)
IS_TRIED = numba.__version__ in TRIED
