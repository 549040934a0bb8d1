"""Measures, stores what was measured as rows, and draws pages of it.

`python -m reports` renders all scenes in both renderers, compares them and draws
index.html; `python -m reports STUDY` measures another study, `--list` names them all.

One room a task, from the top down; imports go no other way:

`command`
    The command line.
`studies`
    One file a study: what is measured, in which cases.
`trials`
    What several studies measure with.
`pages`
    From rows to pages; `study_page` draws any study.
`bench`
    Rows, their store, the runner, timing.
`look`, `charts`
    The look of all pages, pictures, charts.
"""

import mitsuba_ref  # noqa: F401  for what it says where a package is missing
