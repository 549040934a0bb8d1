"""A mutant: our renderer with a mutation, in a separate process with a time limit.

`Mutant.render` has the form of `render_ours`, so that every check of the harness takes a
mutant in the renderer's place. `Mutant.run_tests` runs tests of the suite on it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from mitsuba_ref.mutations.mutation import Mutation, mutant_folder, mutated_files
from mitsuba_ref.our_renderer.picture import OurPicture
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.errors import MitsubaCrashed, MitsubaError, MitsubaTimeout
from mitsuba_ref.reference.json_process import JsonProcess
from renderer.errors import NotReplayable, SceneError
from renderer.kernels.jit.cache import KERNEL_FOLDERS

TIME_LIMIT = 240.0
"""Seconds for one picture or one run of tests, compilation included: a mutation may make a
loop endless. The slowest takes 40 s on an idle machine."""

ROOT = Path(__file__).resolve().parents[2]

# what the renderer says of scenes that it does not take: no sign of a defect
REFUSALS: dict[str, type[Exception]] = {
    "SceneError": SceneError,
    "NotReplayable": NotReplayable,
}


class MutantError(Exception):
    """A mutant refused a scene, ended, or was silent for too long."""


@dataclass(frozen=True)
class SuiteRun:
    """What tests of the suite say of a mutant."""

    failed: tuple[str, ...]  # "test_file.py::test" of those that do not pass
    output: str
    seconds: float


class Mutant:
    """One mutant; a context manager that ends its process.

    Parameters
    ----------
    mutation
        The defect. Its copy of the renderer is made here.
    time_limit
        Seconds for each answer.
    root
        Where copies of the renderer are kept (see `mutant_folder`).

    Raises
    ------
    AnchorError
        If the mutation does not fit the sources.
    """

    def __init__(
        self, mutation: Mutation, time_limit: float = TIME_LIMIT, root: Path | None = None
    ) -> None:
        self.mutation = mutation
        self.time_limit = time_limit
        self.folder = mutant_folder(mutation, root)
        self._edited = {name.partition("/")[0] for name in mutated_files(mutation)}
        self._process: JsonProcess | None = None
        self._answers = tempfile.TemporaryDirectory()

    def __enter__(self) -> Self:
        """Return the mutant; its process starts with the first picture."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.stop()
        self._answers.cleanup()

    def render(self, request: RenderRequest) -> OurPicture:
        """Render as `our_renderer.picture.render_ours` does, with the defect.

        Raises
        ------
        MutantError
            When the mutant raises, ends, or is silent for the time limit.
        """
        path = Path(self._answers.name) / "picture.npz"
        answer = self._ask({"request": asdict(request), "path": str(path)})
        with np.load(path) as stored:
            arrays = {name: stored[name] for name in stored.files}
        path.unlink()
        return OurPicture(arrays=arrays, **answer | {"files": tuple(answer["files"])})

    def run_tests(self, tests: tuple[str, ...]) -> SuiteRun:
        """Run tests of tests/ on the mutant.

        Parameters
        ----------
        tests
            As "test_file.py::test", the names that pytest gives them.

        Raises
        ------
        MutantError
            When they do not end within the time limit, or pytest cannot run them.
        """
        started = time.perf_counter()
        # `-m` puts the current folder first on the path, where the mutant lies; pytest's
        # own setting would put the unharmed renderer before it.
        command = [sys.executable, "-m", "pytest", "-o", "pythonpath=", "-q", "-rfE"]
        command += ["-p", "no:cacheprovider", "-p", "no:xdist", "--tb=line"]
        command += [_place_of(test) for test in tests]
        run = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self._environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            output = run.communicate(timeout=self.time_limit)[0].decode(errors="replace")
        except subprocess.TimeoutExpired:
            raise MutantError(f"tests did not end within {self.time_limit:g} s") from None
        finally:
            # whatever the tests have started goes with them
            with suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)
            run.communicate()
        if run.returncode not in (0, 1):  # neither all passed nor some failed
            raise MutantError(f"pytest ended with status {run.returncode}: {output[-500:]}")
        return SuiteRun(_failures(output), output, time.perf_counter() - started)

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.close()

    def _ask(self, question: dict[str, Any]) -> dict[str, Any]:
        try:
            if self._process is None:
                self._process = JsonProcess(
                    "mitsuba_ref.mutations.mutant_process",
                    {},
                    name=self.mutation.name,
                    time_limit=self.time_limit,
                    environment=self._environment(),
                    folder=self.folder,
                    refusals=REFUSALS,
                )
            return self._process.ask(question)
        except (MitsubaCrashed, MitsubaTimeout) as error:
            self.stop()
            raise MutantError(str(error)) from None
        except MitsubaError as error:  # it has answered, and renders the next picture
            raise MutantError(str(error)) from None
        except tuple(REFUSALS.values()):
            raise
        except BaseException:
            self.stop()  # Ctrl-C: a late answer must not meet a later question
            raise

    def _environment(self) -> dict[str, str]:
        paths = [str(self.folder), str(ROOT)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        if self._edited.isdisjoint(KERNEL_FOLDERS):
            return environment  # its kernels are the renderer's own, and kept by content
        return environment | {
            # deleted with its folder
            "LIGHTPROOF_CACHE": str(self.folder / "cache"),
            # Pictures are small and compiling is all the time there is: 36 % less of it
            # on the Cornell box. IEEE arithmetic is the same at any level.
            "NUMBA_OPT": "1",
        }


def _place_of(test: str) -> str:
    """Return what pytest is told for "test_file.py::test"; files lie in rooms of tests/."""
    file, separator, name = test.partition("::")
    places = list((ROOT / "tests").rglob(file))
    if len(places) != 1:
        raise MutantError(f"{file}: {len(places)} files of tests/ have that name")
    return f"{places[0]}{separator}{name}"


def _failures(output: str) -> tuple[str, ...]:
    """Return the names in pytest's lines "FAILED tests/test_file.py::test - why"."""
    found = []
    for line in output.splitlines():
        word, _, rest = line.partition(" ")
        if word in ("FAILED", "ERROR"):
            file, separator, test = rest.partition(" - ")[0].partition("::")
            found.append(f"{Path(file).name}{separator}{test}")
    return tuple(found)
