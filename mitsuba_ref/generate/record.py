"""The record of a run: JSON lines that are only added, so that a run can go on."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mitsuba_ref.generate.judge import AGREE, CLASSES, STOPPED, Judgement

ENDED = Judgement(STOPPED, "the process ended in the middle of this scene", "ended")


class Record:
    """What is known of the scenes of one seed.

    Parameters
    ----------
    seed
        Of the scenes; lines of other seeds stay as they are.
    path
        The file, which need not exist; None: nothing is kept.

    Attributes
    ----------
    known : dict
        Number of a scene -> its judgement. A scene that was begun and has none ended its
        process, by a crash or because it took too long: it is not begun again.
    """

    def __init__(self, seed: int, path: Path | None) -> None:
        self._seed, self._path = seed, path
        self.known: dict[int, Judgement] = {}
        for line in self._lines():
            number = int(line["number"])
            given = {k: v for k, v in line.items() if k not in ("seed", "number", "begun")}
            self.known[number] = _judgement(given) if given else ENDED

    def begin(self, number: int) -> None:
        """Note that a scene is rendered now."""
        self._add({"seed": self._seed, "number": number, "begun": True})

    def add(self, number: int, judgement: Judgement) -> None:
        """Note what was found."""
        self.known[number] = judgement
        values = {k: v for k, v in asdict(judgement).items() if v}
        if judgement.verdict == AGREE:
            values.pop("sentence", None)  # of most lines, and the same
        self._add({"seed": self._seed, "number": number, **values})

    def add_circumstances(self, circumstances: dict[str, Any]) -> None:
        """Note when, by which command and where the scenes before were rendered."""
        self._add({"circumstances": circumstances})

    def _add(self, line: dict[str, Any]) -> None:
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")

    def _lines(self) -> Iterator[dict[str, Any]]:
        if self._path is None or not self._path.exists():
            return
        for text in self._path.read_text(encoding="utf-8").splitlines():
            try:
                line = json.loads(text)
            except ValueError:  # half a line, of a process that was ended
                continue
            if line.get("seed") == self._seed:
                yield line


def _judgement(values: dict[str, Any]) -> Judgement:
    pixel = values.pop("pixel", None)
    return Judgement(
        pixel=None if pixel is None else tuple(pixel), **{"sentence": "", **values}
    )


def summary(judgements: list[Judgement]) -> str:
    """Return how many scenes there are, and how many differences of each class."""
    counts = Counter(judgement.verdict for judgement in judgements)
    words = [f"{counts[name]} {name}" for name in CLASSES]
    return f"{len(judgements)} scenes: {', '.join(words)}"
