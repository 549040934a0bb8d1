"""What a study is, and which there are."""

from __future__ import annotations

import importlib
import io
import pkgutil
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mitsuba_ref.command.stages import Show
from mitsuba_ref.records.json_files import write_atomically
from reports.bench.rows import Row, Table
from reports.errors import OptionError, ReportError

FOLDER = Path(__file__).resolve().parents[1] / "studies"
DESCRIPTIONS = tomllib.loads((FOLDER / "descriptions.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Bench:
    """What a study gets to measure a case with.

    Parameters
    ----------
    study
        Name of the study.
    quick
        Whether a shorter measurement is requested.
    show
        Call it with a sentence about what is being done.
    folder
        Of the page; pictures go to folders in it.
    budget
        Seconds that a study without an end may take for a case.
    options
        Settings of the study that the command line gives as NAME=VALUE.
    earlier
        All rows that the study has in the store, for studies that go on.
    session
        What `Study.session` opened for all cases of this run.
    """

    study: str
    quick: bool = False
    show: Show = field(default=lambda stage: None)
    folder: Path = Path("reports/out")
    budget: float = 3600.0
    options: Mapping[str, str] = field(default_factory=dict)
    earlier: Table = field(default_factory=Table)
    session: Any = None

    def whole(self, name: str, default: int, least: int = 1) -> int:
        """Return an option that is a whole number.

        Raises
        ------
        OptionError
            If it is something else, or below `least`.
        """
        text = self.options.get(name, str(default))
        if not text.isdecimal() or int(text) < least:
            raise OptionError(
                f"--set {name}={text}: expected a whole number, {least} or more"
            )
        return int(text)

    def picture(
        self, case: str, name: str, pixels: NDArray[np.uint8], form: str = "png"
    ) -> Row:
        """Write a picture for the page; return its row.

        Parameters
        ----------
        case
            Of the row.
        name
            Of the picture within the case; contender of the row.
        pixels
            (height, width, 3) or (height, width), sRGB.
        form
            "png", or "jpg" for a small picture that may lose detail.
        """
        buffer = io.BytesIO()
        kind = "JPEG" if form == "jpg" else "PNG"
        Image.fromarray(pixels).save(buffer, kind, optimize=True, quality=85)
        row = self.file(case, name, f"{name}.{form}", buffer.getvalue())
        return replace(row, quantity="picture")

    def file(self, case: str, name: str, file: str, content: bytes) -> Row:
        """Write a file that the page loads; return its row, with the path as value.

        Parameters
        ----------
        case, name
            Case and contender of the row.
        file
            Name of the file within the case.
        content
            What it holds.
        """
        name_of_file = re.sub(r"[^\w.=+-]+", "-", f"{case}-{file}").strip("-")
        path = Path("pictures") / self.study / name_of_file
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(target, content)
        return Row(case=case, contender=name, quantity="file", value=path.as_posix())


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study: what it is called, what it measures, how long it takes.

    Parameters
    ----------
    title
        Of its page.
    sentence
        What it answers, in one sentence.
    advice
        What a reader does with the answer; "" where the page itself says so.
    minutes, quick_minutes
        How long all cases take on two cores, the second with `--quick`.
    measure
        (case, bench) -> rows. Each row is stored as soon as it is yielded.
    cases
        The cases; each is measured as a whole and not again when a command is resumed.
    quick_cases
        Those of `--quick`; None: all.
    any_case
        Whether `--case` may name other cases, such as a scene file.
    axis
        What `Row.at` means, such as "samples per pixel"; "" if rows have no place.
    about
        What some of the cases are, a few sentences each.
    goes_on
        Whether each run adds to the rows of earlier runs, until `measure` yields nothing.
    aims
        Of a study that goes on: the sum of the quantity "done" that completes each case.
    headlines
        Quantities that the page "history" shows over the runs; empty: the first ones.
    inputs
        Returns a text that changes with what a case is measured on, such as a hash of a
        scene's files; a case with other inputs is measured again.
    options
        Settings that `measure` knows, with their help.
    page
        "module:function" that turns the study's rows into a page; "" draws a table of each
        quantity, and a chart of each that has an axis.
    pages
        Instead of `page`, for a study with several pages or with records of its own:
        "module:function" that gets (name, study, table, folder of the pages) and returns
        the HTML of each page by its file name.
    session
        Opens what the cases of a run share, such as a process of Mitsuba: gets the cases
        and the bench, returns a context manager; its value is `Bench.session`.
    verdict
        From the rows to one sentence that answers the study's question; it stands at the
        top of the page and on its card of the index, and the command says it.
    """

    title: str
    sentence: str
    minutes: float
    measure: Callable[[str, Bench], Iterator[Row]]
    advice: str = ""
    quick_minutes: float | None = None
    cases: Sequence[str] | Callable[[], Sequence[str]] = ("all",)
    quick_cases: Sequence[str] | None = None
    any_case: bool = False
    axis: str = ""
    about: Mapping[str, str] = field(default_factory=dict)
    goes_on: bool = False
    aims: Mapping[str, int] = field(default_factory=dict)
    headlines: Sequence[str] = ()
    inputs: Callable[[str, Mapping[str, str]], str] = lambda case, options: ""
    options: Mapping[str, str] = field(default_factory=dict)
    page: str = ""
    pages: str = ""
    session: Callable[[Sequence[str], Bench], AbstractContextManager[Any]] = (
        lambda cases, bench: nullcontext()
    )
    verdict: Callable[[Table], str] = lambda table: ""

    def chosen(self, names: Sequence[str], quick: bool) -> list[str]:
        """Return the cases to measure.

        Raises
        ------
        ReportError
            If there is no case of a name.
        """
        every = list(self.cases() if callable(self.cases) else self.cases)
        if not names:
            return list(self.quick_cases) if quick and self.quick_cases else every
        for name in names:
            if name not in every and not self.any_case:
                raise ReportError(f"case {name!r} is unknown; there are {', '.join(every)}")
        return list(names)


def described(name: str, **measured: Any) -> Study:
    """Return the study that `descriptions.toml` has under a name.

    Parameters
    ----------
    name
        Of the study.
    **measured
        The fields of `Study` that are code: its cases, how they are measured and judged.
    """
    return Study(**DESCRIPTIONS[name], **measured)


def study_names() -> list[str]:
    """Return the names of all studies."""
    modules = pkgutil.iter_modules([str(FOLDER)])
    return [m.name.replace("_", "-") for m in modules if not m.name.startswith("_")]


def page_file(name: str) -> str:
    """Return the file name of a study's page."""
    return f"{name.replace('-', '_')}.html"


def find_study(name: str) -> Study:
    """Import a study.

    Raises
    ------
    ReportError
        If there is no study of this name, or a package that it needs is missing.
    """
    if name not in study_names():
        raise ReportError(
            f"study {name!r} is unknown; there are {', '.join(study_names())}"
        )
    try:
        module = importlib.import_module(f"reports.studies.{name.replace('-', '_')}")
    except ModuleNotFoundError as error:
        raise ReportError(
            f"study {name} needs the package {error.name!r}; the extras of lightproof, "
            "such as lightproof[cluster], install it"
        ) from None
    study: Study = module.STUDY
    return study


def available_studies() -> dict[str, Study]:
    """Return the studies whose packages are installed, by name."""
    found = {}
    for name in study_names():
        with suppress(ReportError):
            found[name] = find_study(name)
    return found
