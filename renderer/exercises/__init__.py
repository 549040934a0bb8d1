"""Exercises along the lecture: a stub to fill in, and a check that names the mistake.

One chapter of the lecture is one file in `chapters/`. An exercise is one entry there: the
right functions, whose signatures and docstrings become the stub; the inputs; the typical
mistakes; the picture. A mistake is a small change in the right function that its keyword
`variants` switches on. `judge.py` compares what a student's functions return with what the
right functions return, and with what the functions with each mistake return.

Nothing here imports Numba: an exercise is listed, written and checked in a second.
"""
