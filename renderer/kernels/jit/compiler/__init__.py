"""Parts of Numba's compiler that are replaced, so that kernels compile in seconds.

Each file says what and why; `docs/decisions/compile-time.md` says what it saves. On a
version of Numba that has not been tried nothing is replaced (`versions`).
"""
