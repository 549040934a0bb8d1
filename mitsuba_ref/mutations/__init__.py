"""Tests of the tests: our renderer with a known defect, and which check sees it.

A mutation replaces a piece of source in a *copy* of `renderer/`, which runs in a separate
process and compiles its own kernels. The renderer itself has no code for mutations.

`source_edit` (a replacement in a named definition) -> `mutation` (what a mutation is, how a
copy is made) -> `mutant, mutant_process` (a renderer with the defect, as a function) ->
`rungs, climbing` (the checks, from cheap to expensive) -> `matrix` (all mutations against
all checks). `defects` holds the mutations as TOML tables.
"""
