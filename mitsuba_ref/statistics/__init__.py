"""Statistical tests that know about noise: NumPy arrays in, small records out.

Two renderers are two samples of pictures: K pictures each, with independent seeds. Each
module holds one test, what it assumes and what it cannot see; `docs/statistics.md` has
their measured false alarm rates. The tests need the box filter, with which pixels share no
samples, where they say so.
"""
