"""Tests of the tests: our renderer with a known defect, and which check sees it.

A mutation replaces a piece of text in a *copy* of `renderer/`, which runs in a process of
its own with kernels of its own. The renderer itself knows nothing of mutations.

`mutation` (what a mutation is, how a copy is made) -> `mutant, mutant_process` (a renderer
with the defect, as a function) -> `rungs, climbing` (the checks, from cheap to dear) ->
`matrix` (all mutations against all checks). `catalogue` lists the mutations.
"""
