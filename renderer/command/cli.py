"""The command `lightproof`, also `python -m renderer`: a scene file into a picture."""

from __future__ import annotations

import argparse
import importlib
import sys
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import renderer
from renderer.command.built_in_scenes import demos
from renderer.command.interrupts import Interrupts
from renderer.command.options import read_options, render_options
from renderer.command.outputs import (
    check_distinct,
    check_not_read,
    check_outputs,
    command_of,
    complain,
    default_output,
    listed,
    rate_line,
    report,
    signed,
    write_all,
)
from renderer.command.watchers import Watcher, end_all, open_watchers
from renderer.errors import CheckpointWarning, ClusterError, SceneError
from renderer.process.cache_folder import cache_root, clear_caches
from renderer.process.memory import limited_to
from renderer.process.signals import leave_deleted_folder, output_is_lost
from renderer.rendering.render_options import OPTIONS

if TYPE_CHECKING:  # what imports Numba, half a second, is imported where it is used
    from renderer.rendering.cluster.source import ClusterWorkers
    from renderer.rendering.picture.image import Image
    from renderer.rendering.progress_display import Progress
    from renderer.scene.scene import Scene
    from renderer.scene_file import SceneDescription

# what imports C code, in which no interrupt must fall, before a scene is read
_WITH_C_CODE = ("renderer.rendering.picture.image_files", "renderer.scene.scene")


def main(
    arguments: Sequence[str] | None = None,
    read: Callable[[Sequence[str] | None], argparse.Namespace] | None = None,
    run: Callable[[argparse.Namespace, Interrupts, list[Path]], int] | None = None,
) -> int:
    """Render a scene file and write the picture; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    read, run
        What reads them, and what then works and returns the status, of another command that
        fails and is interrupted as this one; None: of `lightproof`.
    """
    written: list[Path] = []
    interrupts = Interrupts()
    try:
        with interrupts:
            options = (read or read_options)(arguments)
            with limited_to(options.memory):
                return (run or _run)(options, interrupts, written)
    except SystemExit as stop:
        return int(stop.code or output_is_lost())
    except (SceneError, ClusterError) as error:
        complain(f"error: {error}")
    except MemoryError:
        complain("error: there is not enough memory for this picture or scene")
    except KeyboardInterrupt:
        return _interrupted(written)
    except Exception:
        if not interrupts.count:
            raise
        # An extension module that is being imported makes an ImportError of an interrupt.
        return _interrupted(written)
    return 1


def _interrupted(written: list[Path]) -> int:
    complain(f"interrupted; wrote {listed(written) or 'nothing'}")
    return 130


def _run(options: argparse.Namespace, interrupts: Interrupts, written: list[Path]) -> int:
    if options.compare is not None:
        from renderer.command.compare_pictures import compare

        return compare(*options.compare, quiet=options.quiet) or int(output_is_lost())
    if options.clear_cache:
        return _clear_caches()
    if options.compile:
        from renderer.command.compile_kernels import compile_kernels

        return compile_kernels(quiet=options.quiet)
    with interrupts.put_off():  # they are there when the functions below import them
        for module in _WITH_C_CODE:
            importlib.import_module(module)
        from renderer.scene_file.plugins import import_plugin_file

    draws = options.frames is not None or not options.explain
    leave_deleted_folder(options, needs_output=draws)
    if options.plugins is not None:
        import_plugin_file(str(options.plugins))
    path = scene_file(options.scene)
    if draws and not options.output:
        output = default_output(path)
        if options.frames is not None:
            output = output.with_stem(f"{output.stem}_####")
        options.output = [output]
    if options.frames is not None:
        return _run_frames(options, path, interrupts, written)
    check_outputs(options)
    scene = _load(options, path)
    if options.explain:
        _explain(scene, options)
    if not options.output:
        return int(output_is_lost())
    if _needs_bands(scene, options, interrupts):
        _render_to_file(scene, options, interrupts)
        return 0
    with open_watchers(options, interrupts) as watchers:
        with _cluster(options, interrupts) as workers:
            image = _render(scene, options, interrupts, workers, watchers)
        status = deliver(image, options, interrupts, written)
        end_all(watchers, image, interrupts)
    return status


def _clear_caches() -> int:
    """Remove the caches and say what was in them; return the exit status."""
    try:
        removed = clear_caches()
    except OSError as error:
        raise SceneError(f"{cache_root()}: {error.strerror}: {error.filename}") from None
    for name, files, size in removed:
        sys.stdout.write(f"removed {name}: {files} files, {size / 1e6:.1f} MB\n")
    if not removed:
        sys.stdout.write(f"nothing is kept in {cache_root()}\n")
    return int(output_is_lost())


def scene_file(given: Path) -> Path:
    """Return the file of a scene that is given by it or by its folder.

    Raises
    ------
    SceneError
        If there is none, and the name is that of a scene that is installed.
    """
    if str(given) in demos() and not given.exists():
        raise SceneError(
            f"{given}: no such scene file; `lightproof demo {given}` renders the scene of "
            "that name that is installed"
        )
    return given / "scene.xml" if given.is_dir() else given


def deliver(
    image: Image, options: argparse.Namespace, interrupts: Interrupts, written: list[Path]
) -> int:
    """Write a picture and say so; return the exit status.

    Raises
    ------
    KeyboardInterrupt
        If a second Ctrl-C wants to end without it.
    """
    if interrupts.count > 1:
        raise KeyboardInterrupt
    write_all(image, options.output, written)
    report(image, written, options)
    if interrupts.count:
        return 130
    return 0 if image.complete and len(written) == len(options.output) else 1


def _run_frames(
    options: argparse.Namespace, path: Path, interrupts: Interrupts, written: list[Path]
) -> int:
    """Render a sweep, and return the exit status."""
    from renderer.command.sweep import SweepRecord, made_from, of_frame

    frames = [of_frame(options, frame) for frame in options.frames]
    for each in frames:
        check_outputs(each)
    check_distinct([output for each in frames for output in each.output])
    record = SweepRecord(options.output[0])
    record.read()  # without --resume too: what it says of frames written anew must go
    under_way: deque[tuple[argparse.Namespace, str]] = deque()  # not yet written

    def scenes() -> Iterator[Scene]:
        for each in frames:
            scene = _load(each, path)
            key = made_from(
                scene, f"{command_of(each)} {each.target_error} {each.time_limit}"
            )
            if not (options.resume and record.has(each.output, key)):
                under_way.append((each, key))
                yield scene

    image: Image | None = None
    with (
        open_watchers(options, interrupts) as watchers,
        _cluster(options, interrupts) as workers,
        _showing(options, interrupts, watchers) as show,
    ):
        requested = render_options(options, progress=show, cluster=workers, resume=False)
        images = renderer.render_frames(scenes(), **vars(requested))
        for image in images:
            each, key = under_way.popleft()
            if interrupts.count > 1:
                raise KeyboardInterrupt
            files: list[Path] = []
            record.remove(each.output)
            write_all(signed(image, each), each.output, files)
            written += files
            report(image, files, options)
            if interrupts.count or not image.complete or len(files) < len(each.output):
                end_all(watchers, image, interrupts)
                return 130 if interrupts.count else 1
            record.add(files, key)
        end_all(watchers, image, interrupts)
    if len(written) < len(frames) * len(options.output) and not options.quiet:
        complain(f"{len(frames) - len(written) // len(options.output)} frames were there")
    return 0


def _load(options: argparse.Namespace, path: Path) -> Scene:
    from renderer.scene.scene import build_scene

    scene = build_scene(describe(options, path))
    say_warnings(scene.description)
    return scene


def describe(options: argparse.Namespace, path: Path) -> SceneDescription:
    """Read a scene with what the options replace and leave out of it."""
    from renderer.scene_file import read_file_with

    description = read_file_with(path, dict(options.define), options.allow_outside)
    plugins = filter(None, [getattr(options, "plugins", None)])
    check_not_read(options.output, [*description.files, *plugins])
    if options.simplify:
        from renderer.advice.simplifications import simplified

        for word in options.simplify:
            description = simplified(description, word)
    return description


def say_warnings(description: SceneDescription) -> None:
    """Write what the reader noticed to standard error."""
    for warning in description.warnings:
        complain(f"warning: {warning}")


def _explain(scene: Scene, options: argparse.Namespace) -> None:
    from renderer.command.plan_text import plan_text

    sys.stdout.write(plan_text(scene, **vars(render_options(options))))
    sys.stdout.flush()


@contextmanager
def _cluster(
    options: argparse.Namespace, interrupts: Interrupts
) -> Iterator[ClusterWorkers | None]:
    """Give the workers of `--cluster`, and say at the end what they did; or None."""
    if options.cluster is None:
        yield None
        return
    with interrupts.put_off():
        from renderer.rendering.cluster.connect import open_cluster

    if not options.quiet:
        complain(f"cluster: waiting for {options.cluster}")
    with open_cluster(options.cluster) as workers:
        try:
            yield workers
        finally:
            for address, why in workers.tally.refused.items():
                complain(f"warning: worker {address} was refused: {why}")
            if not options.quiet:
                complain(f"cluster: {workers.tally}")


@contextmanager
def _showing(
    options: argparse.Namespace, interrupts: Interrupts, watchers: Sequence[Watcher] = ()
) -> Iterator[Callable[[Progress], None]]:
    """Show progress, warnings at once, and end a render after Ctrl-C."""
    with interrupts.put_off():
        importlib.import_module("renderer.rendering.render")
        from renderer.rendering.progress_display import ProgressDisplay

    with (
        ProgressDisplay(sys.stderr, quiet=options.quiet) as display,
        warnings.catch_warnings(),
    ):
        # at once: the render may take hours from then on
        warnings.simplefilter("always", CheckpointWarning)
        warnings.showwarning = _show_warning

        def progress(now: Progress) -> None:
            # compiling, there is nothing to save, and Ctrl-C need not wait for the end
            interrupts.held = now.stage == "render"
            if interrupts.held and interrupts.count:
                raise KeyboardInterrupt
            display(now)
            for watcher in watchers:
                watcher(now)

        yield progress


def _render(
    scene: Scene,
    options: argparse.Namespace,
    interrupts: Interrupts,
    workers: ClusterWorkers | None,
    watchers: Sequence[Watcher],
) -> Image:
    with _showing(options, interrupts, watchers) as progress:
        requested = render_options(options, progress=progress, cluster=workers)
        image = renderer.render(scene, **vars(requested))
    return signed(image, options)


def _needs_bands(
    scene: Scene,
    options: argparse.Namespace,
    interrupts: Interrupts,
) -> bool:
    """Tell whether the film is larger than memory, and can go into its file in bands."""
    outputs, requested = options.output, render_options(options)
    if options.view or options.tev is not None:
        return False
    if len(outputs) > 1 or outputs[0].suffix.lower() != ".exr":
        return False
    if not all("bands" in OPTIONS[name].roles for name in requested.given()):
        return False
    with interrupts.put_off():
        from renderer.rendering.render_to_file import fits_in_memory

    return fits_in_memory(scene, requested) is False


def _render_to_file(
    scene: Scene, options: argparse.Namespace, interrupts: Interrupts
) -> None:
    (output,) = options.output
    if not options.quiet:
        complain(
            f"the film is larger than memory: it is written to {output} in bands, and "
            "nothing is kept of it after an interrupt"
        )
    with _showing(options, interrupts) as progress:
        command = {"command": command_of(options)}
        requested = render_options(options, progress=progress, metadata=command)
        file = renderer.render_to_file(scene, output, **vars(requested))
    if not options.quiet:
        sys.stdout.write(rate_line(file, str(output)))
        sys.stdout.flush()


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    complain(f"warning: {message}")
