"""Studies with a section of their own on the page "accelerators"; one line adds one.

Each measures something that JSON can hold, and draws a section from that alone, so that
`--from` draws an old record again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class FurtherStudy(NamedTuple):
    """How one study is measured and drawn."""

    title: str
    measure: Callable[[bool], Any]  # whether it is the quick one -> what JSON can hold
    # what was measured -> the section as HTML: without its title, or a whole <section>
    # whose title has the study's key as its id
    section: Callable[[Any], str]


# key in accelerators.json and id on the page -> the study; shown in this order
FURTHER_STUDIES: dict[str, FurtherStudy] = {}
