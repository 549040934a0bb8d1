"""Draws what was measured: results.json in, one self-contained HTML page out.

`python -m reports` runs the harness on every scene and draws the page;
`python -m reports.benchmark` times the renderers in turn, `python -m reports.accelerators`
everything that finds hits. This package computes no image: it reads the numbers and the
pictures that `mitsuba_ref` wrote.
"""
