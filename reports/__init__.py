"""The laboratory: studies yield rows, a store keeps them, pages show them.

`python -m reports scenes` renders all scenes in both renderers and draws index.html;
`python -m reports --list` names the other studies. One room a purpose, from the top down;
imports go no other way:

`command`
    The command line.
`studies`
    One file a study: its name, its sentence, and a function that yields rows.
`trials`
    What several studies measure with: meshes, rays, contenders, scenes.
`pages`
    From rows to HTML; most studies have the general page `study_page`.
`atlas`
    Where methods fail: the texts and boundaries that the study `limits` checks.
`bench`
    Rows, the store, the runner and timing.
`look`, `charts`
    The look of all pages, and charts.
`measured`
    The rows that the repository keeps.
"""

import mitsuba_ref  # noqa: F401  for what it says where a package is missing
