"""Draws what was measured: JSON in, self-contained HTML pages out.

`python -m reports` runs the harness on every scene and draws all pages;
`python -m reports.benchmark` times the renderers in turn, `python -m reports.accelerators`
everything that finds hits, `python -m reports.proof` replays and tests,
`python -m reports.limits` puts methods under stress until they fail. Only the
last computes images of its own; the others read what `mitsuba_ref` wrote.

One room a page or study, from the top down; imports go no other way:

`commands`
    Measure, write the records, draw the pages.
`scenes_page`, `proof_page`, `accelerator_page`
    From records to a page.
`limits`, `needs`, `soak`, `history`
    Studies with a page of their own: where methods fail, what a scene
    needs, what is rare, how records changed.
`beside_peers`
    Pictures and rays of several scenes beside Mitsuba and Embree.
`accelerator_study`, `speed`, `moving_scene`, `bounding_volume_study`, `cluster_study`
    From measurements to records; small ones draw their section, too.
`accelerator_trials`
    One accelerator on one mesh, checked, counted and timed.
`page`, `charts`, `records`
    The look of all pages, charts, and JSON files as dataclasses.
"""

import mitsuba_ref  # noqa: F401  for what it says where a package is missing
