"""The command `lightproof`: what it writes, says and returns, also when interrupted."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest

import renderer
from renderer.command import outputs
from renderer.command.cli import main
from renderer.errors import ClusterError, NotAllowed
from renderer.rendering import render as road
from renderer.rendering.film.film import SAMPLES_PER_JOB
from renderer.rendering.job import RenderJob
from renderer.rendering.picture.image import Image
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.progress_display import Progress, ProgressDisplay
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

pytestmark = pytest.mark.usefixtures("in_an_empty_folder", "heeding_interrupts")

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "scenes"
CORNELL = str(SCENES / "cornell-box" / "scene.xml")
SMALL = [CORNELL, "-D", "width=32", "-D", "height=32", "--spp", "4"]
ENDLESS = [CORNELL, "-D", "width=64", "-D", "height=64", "--spp", "4000000"]


def header(path):
    with OpenEXR.File(str(path)) as file:
        return dict(file.header())


def pixels(path):
    with OpenEXR.File(str(path)) as file:
        return np.array(file.channels()["RGB"].pixels)


@pytest.fixture
def start():
    """Starts the command in a process of its own, which ends with the test."""
    started = []

    def start_one(*arguments, **environment):
        started.append(_process(*arguments, **environment))
        return started[-1]

    yield start_one
    for process in started:
        process.kill()
        process.communicate()


# A shell in the background ignores SIGINT, and so would its children. A program of its own
# and no `preexec_fn`, which may wait for ever for a lock that another thread holds.
HEED_INTERRUPTS = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.executable, [sys.executable, "-m", "renderer", *sys.argv[1:]])
"""


def _process(*arguments, **environment):
    return subprocess.Popen(
        [sys.executable, "-c", HEED_INTERRUPTS, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for(process, beginning):
    """Read the process's standard error to the line that begins so."""
    for line in process.stderr:
        if line.startswith(beginning):
            return
    raise AssertionError(f"the process ended before it said {beginning!r}")


# ------------------------------------------------------------------------------- files


def test_every_output_is_written_and_the_summary_names_them(capsys, tmp_path):
    """EXR, PNG and NPY of one render; the last line says size, samples, speed, files."""
    outputs = [tmp_path / name for name in ("a.exr", "b.png", "c.npy")]
    status = main(SMALL + [word for path in outputs for word in ("-o", str(path))])
    assert status == 0
    np.testing.assert_array_equal(pixels(outputs[0]), np.load(outputs[2]))
    assert outputs[1].read_bytes().startswith(b"\x89PNG")
    last = capsys.readouterr().out.splitlines()[-1]
    files = ", ".join(map(str, outputs))
    pattern = r"32 x 32 pixels, 4 spp, [\d.]+ s, [\d.]+ M?samples/s; wrote " + re.escape(
        files
    )
    assert re.fullmatch(pattern, last)


def test_the_picture_is_that_of_the_api(tmp_path):
    main([*SMALL, "--seed", "7", "-o", "a.exr"])
    scene = renderer.load_file(CORNELL, width=32, height=32)
    np.testing.assert_array_equal(pixels("a.exr"), renderer.render(scene, 4, seed=7).pixels)


def test_a_goal_says_its_error_and_the_command_of_the_picture(capsys):
    """The header's command gives the same picture without a goal."""
    assert main([*SMALL[:5], "--target-error", "25%", "-o", "a.exr"]) == 0
    assert re.search(r"estimated error: \d+\.\d+%", capsys.readouterr().out)
    found = header("a.exr")
    assert 0.0 < float(found["error"]) <= 0.25
    command = found["command"].split()
    assert "--target-error" not in command and "--sampler" in command
    assert main([*command[1:], "-o", "b.exr"]) == 0
    np.testing.assert_array_equal(pixels("a.exr"), pixels("b.exr"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--target-error", "2"], "2 is 100 % or more; is 2% meant?"),
        (["--target-error", "-1%"], "-1 is not more than 0"),
        (["--time", "inf"], "inf is not more than 0, and finite"),
        (["--time", "soon"], "'soon' is no number"),
    ],
)
def test_goals_that_are_none(words, message, capsys):
    assert main([*SMALL, f"{words[0]}={words[1]}"]) == 2
    assert message in capsys.readouterr().err


def test_without_output_the_picture_is_named_after_the_scene(capsys, tmp_path):
    """A scene.xml gives the name of its folder; the folder alone will do as the scene."""
    assert main([str(SCENES / "cornell-box"), *SMALL[1:]]) == 0
    assert capsys.readouterr().out.endswith("; wrote cornell-box.exr\n")
    assert pixels("cornell-box.exr").shape == (32, 32, 3)
    assert outputs.default_output(Path("/models/teapot.xml")) == Path("teapot.exr")
    assert outputs.default_output(Path("scene.xml")) == Path(f"{tmp_path.name}.exr")


def test_equal_renders_give_equal_bytes_at_any_number_of_threads():
    """Nothing of time, machine, threads or file name is in a file."""
    for threads in ("1", "2"):
        main([*SMALL, "--threads", threads, "-o", f"{threads}.exr", "-o", f"{threads}.png"])
    assert Path("1.exr").read_bytes() == Path("2.exr").read_bytes()
    assert Path("1.png").read_bytes() == Path("2.png").read_bytes()


def test_the_header_says_how_to_make_the_picture_again():
    main([*SMALL, "--seed", "3", "--threads", "2", "-o", "a.exr"])
    found = header("a.exr")
    assert found["lightproof"] == renderer.__version__
    assert found["integrator"] == "path"
    assert found["sampler"] == "independent"
    assert found["seed"] == "3"
    assert found["spp"] == 4
    assert found["command"].endswith("--spp 4 --seed 3 -D width=32 -D height=32")
    assert "interrupted" not in found


def test_what_can_be_written_is_written(capsys, monkeypatch):
    """A folder that vanishes while rendering costs its file alone; NaN is a warning."""
    Path("gone").mkdir()

    def render(scene, **_):
        shutil.rmtree("gone")
        return Image(np.full((2, 2, 3), np.nan, np.float32), spp=1)

    monkeypatch.setattr(renderer, "render", render)
    assert main([CORNELL, "-o", "gone/a.exr", "-o", "b.png"]) == 1
    out, err = capsys.readouterr()
    assert "error: gone/a.exr: there is no folder 'gone' to write to\n" in err
    assert "warning: b.png: 4 of 4 pixels are NaN or infinite" in err
    assert out.endswith("; wrote b.png\n")
    assert Path("b.png").is_file()


# ------------------------------------------------------------------ what was wrong


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([CORNELL, "--integrator", "bdpt"], "'bdpt' (choose from 'auto', 'direct'"),
        ([CORNELL, "--accel", "octopus"], "'octopus' (choose from 'auto', 'brute'"),
        ([CORNELL, "--accel", "kd-sha"], "; did you mean kd-sah?; --help lists"),
        ([CORNELL, "--sampler", "halton"], "'halton' (choose from 'independent', 'str"),
        ([CORNELL, "--spp", "0"], "argument --spp: 0 is less than 1"),
        ([CORNELL, "--spp", "many"], "argument --spp: 'many' is no whole number"),
        ([CORNELL, "--threads", "-1"], "argument --threads: -1 is less than 1"),
        ([CORNELL, "--seed", "4294967296"], "4294967296 is not in 0 to 4294967295"),
        ([CORNELL, "-D", "width"], "'width' is not of the form name=value"),
        ([CORNELL, "-D", "=3"], "'=3' is not of the form name=value"),
        ([CORNELL, "--sp", "3"], "unrecognized arguments: --sp 3"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_status_2(capsys, arguments, complaint):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("lightproof: error: ")
    assert err.count("\n") == 1
    assert complaint in err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["nowhere.xml"], "nowhere.xml: no such scene file"),
        ([CORNELL, "-D", "widht=3"], "no use of the parameter widht=3; the scene has: he"),
        ([CORNELL, "-D", "path=3"], "no use of the parameter path=3"),
        ([CORNELL, "-D", "width=wide"], "cornell-box/scene.xml:22: "),
        ([CORNELL, "--spp", "99999999"], "spp is 99999999; 1 to 16777216 are possible"),
        ([CORNELL, "--threads", "5000"], "threads is 5000; 1 to 1024 are possible"),
        (
            [CORNELL, "-o", "a.jpg"],
            "a.jpg: the ending '.jpg'; pictures are written as .exr",
        ),
        ([CORNELL, "-o", "nowhere/a.exr"], "there is no folder 'nowhere' to write to"),
    ],
)
def test_what_cannot_be_rendered_is_one_line_and_status_1(capsys, arguments, complaint):
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert complaint in err
    assert not list(Path().iterdir())


def test_a_folder_that_is_not_writable_is_noticed_before_rendering(capsys, monkeypatch):
    """By a stand-in for os.access, as nothing is closed to the superuser."""
    monkeypatch.setattr("os.access", lambda path, mode: False)
    monkeypatch.setattr(renderer, "render", None)  # calling it would be a TypeError
    assert main([CORNELL, "-o", "a.exr"]) == 1
    assert capsys.readouterr().err == "error: a.exr: the folder '.' is not writable\n"


def test_a_picture_does_not_replace_what_it_is_rendered_from(capsys, tmp_path):
    """A texture, the scene itself by a link, a file of plugins; with frames too."""
    PIL.Image.new("RGB", (4, 4), "grey").save("wall.png")
    scene = Path("scene.xml")
    scene.write_text(
        '<scene version="3.0.0"><emitter type="envmap"><string name="filename" '
        'value="wall.png"/></emitter><sensor type="perspective"/></scene>'
    )
    Path("link.exr").symlink_to("scene.xml")
    Path("frame_1.png").symlink_to("wall.png")
    before = {file: file.read_bytes() for file in (scene, Path("wall.png"))}
    for words in (
        ["-o", "wall.png"],
        ["-o", str(tmp_path / "link.exr")],
        ["--frames", "1:2", "-o", "frame_#.png"],
    ):
        assert main(["scene.xml", "--spp", "1", *words]) == 1
        said = capsys.readouterr().err
        assert ": the scene reads " in said and said.count("\n") == 1
    assert before == {file: file.read_bytes() for file in before}


def test_two_frames_are_not_one_file(capsys):
    """A link from one to the other would lose a picture."""
    Path("a_0.png").symlink_to("a_1.png")
    assert main([*SMALL, "--frames", "0:2", "-o", "a_#.png"]) == 1
    assert "a_0.png and a_1.png are one file" in capsys.readouterr().err


def test_too_little_memory_is_one_line(capsys, monkeypatch):
    def render(scene, **_):
        raise MemoryError

    monkeypatch.setattr(renderer, "render", render)
    assert main([CORNELL]) == 1
    assert capsys.readouterr().err.startswith("error: there is not enough memory")


def test_the_module_runs_as_a_program(start):
    """`python -m renderer` takes its exit status and its output from `main`."""
    process = start("nowhere.xml", "--bogus")
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "")
    assert err == (
        "lightproof: error: unrecognized arguments: --bogus; --help lists the options\n"
    )


def test_a_reader_that_goes_away_is_no_traceback(start):
    """As in `lightproof --explain | head -1`."""
    process = start(CORNELL, "--explain")
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait(timeout=60) == 1
    process.stderr.close()


# ------------------------------------------------------------------------ explanation


def test_help_and_version(capsys):
    """Help shows examples and every name that can be chosen."""
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for word in ("examples:", "whitted", "bvh", "multijitter", "name=value", "Ctrl-C"):
        assert word in text
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"lightproof {renderer.__version__}\n"


EXPLAINED = {
    "cornell-box": [
        "method        path, as requested",
        "as the mean of random paths (Kajiya 1986)",
        "accelerator   24 triangles: boxes around objects",
        "accelerator   6 rectangles: brute force",
        "- conductor, dielectric, roughconductor, roughdielectric, plastic, ",
        "- textures and uv: no BSDF looks at them",
        "weights       multiple importance sampling: light samples",
        "roulette      Russian, from segment 5 on",
        "- disks, spheres, cylinders, ",
        "instances: the scene has none; not",
        "- point, spot, directional, constant, ",
    ],
    "appel-teapot": [
        "method        direct, as requested",
        "accelerator   6348 triangles: a bounding volume hierarchy",
        "1 per pixel, at its centre: nothing is random",
        "- multiple importance sampling, emission at hits: all lights are points or",
        "- rectangles, disks, spheres, cylinders, ",
        "- spot, directional, constant, ",
    ],
    "depth-and-normals": [
        "file says     aov, and the colours of direct",
        "accelerator   2 rectangles, 1 sphere, 1 cylinder: brute force",
        "The colours, by the integrator inside",
    ],
}


@pytest.mark.parametrize("name", EXPLAINED)
def test_explain_says_what_is_done_and_what_is_left_out(capsys, monkeypatch, name):
    """Without rendering: no file, and `render` is not called."""
    monkeypatch.setattr(renderer, "render", None)
    assert main([str(SCENES / name), "--explain"]) == 0
    text = capsys.readouterr().out
    for line in EXPLAINED[name]:
        assert line in text
    assert text.index("What is done") < text.index("samples")
    assert max(map(len, text.splitlines()[1:])) <= 92
    assert not list(Path().iterdir())


def test_explain_follows_the_options(capsys):
    given = ["--integrator", "direct", "--accel", "bvh", "-D", "width=40"]
    assert main([CORNELL, "--explain", *given]) == 0
    text = capsys.readouterr().out
    assert "40 x 192 pixels" in text
    assert "(Appel 1968)" in text
    assert "hierarchy by the surface area heuristic; as requested" in " ".join(text.split())


def test_explain_with_an_output_renders_too(capsys):
    assert main([*SMALL, "--explain", "-o", "a.exr"]) == 0
    out = capsys.readouterr().out
    assert out.index("What is done") < out.index("wrote a.exr")
    assert Path("a.exr").is_file()


@pytest.mark.parametrize(
    ("sampler", "wanted", "count"),
    [
        ("independent", 5, 5),
        ("stratified", 5, 9),
        ("multijitter", 5, 6),
        ("orthogonal", 10, 25),
        ("ldsampler", 5, 16),
        ("stratified", 16, 16),
    ],
)
def test_samples_are_rounded_as_mitsuba_rounds_them(capsys, sampler, wanted, count):
    """Mitsuba's `set_sample_count` gives these [run, 3.9.1]; the explanation says so."""
    assert main([CORNELL, "--explain", "--sampler", sampler, "--spp", str(wanted)]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert f"samples {count} per pixel, {sampler}" in words
    assert (f"({wanted} requested; the sampler needs" in words) == (wanted != count)


@pytest.mark.parametrize(("spp", "net"), [(3000, 4096), (4096, None), (5000, None)])
def test_a_net_is_recommended_where_there_is_one(spp, net):
    """Those with matrices of their own end at 4096 points."""
    scene = renderer.load_file(CORNELL)
    lines = " ".join(make_plan(scene, spp=spp, sampler="sobol").lines)
    assert (f"({net} would be a net" in lines) == ("would be a net" in lines) == bool(net)


def test_more_samples_of_a_fixed_grid_are_a_finer_grid():
    """Mitsuba's `stratified` without jitter takes 16 positions when 16 are requested."""
    scene = renderer.load_file(SCENES / "appel-teapot" / "scene.xml")
    plan = make_plan(scene, spp=16)
    assert (plan.spp, plan.sampler.jitter) == (16, False)
    assert "on a fixed grid of 4 x 4: nothing is random" in "\n".join(plan.lines)


# --------------------------------------------------------------------------- progress


def test_warnings_of_the_scene_are_said_once(capsys, caplog):
    """On standard error; the log, which `load_file` writes, stays empty."""
    main([str(SCENES / "depth-and-normals"), "-D", "spp=5", "--explain"])
    err = capsys.readouterr().err
    assert err.count("warning") == 1
    assert not caplog.records
    assert err.startswith("warning: ")
    assert "rounds 5 samples up to 9" in err


def test_quiet_says_nothing(capsys):
    assert main([*SMALL, "--quiet", "-o", "a.exr"]) == 0
    assert capsys.readouterr() == ("", "")
    assert Path("a.exr").is_file()


class Terminal(io.StringIO):
    def isatty(self):
        return True


STEPS = [
    Progress("compile", 0, 1, 0.0),
    Progress("compile", 1, 1, 12.34),
    Progress("render", 0, 40000000, 0.0),
    Progress("render", 10000000, 40000000, 10.0),
    Progress("render", 40000000, 40000000, 20.0),
]


def test_a_terminal_shows_a_bar_with_time_left_and_speed(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "90")
    stream = Terminal()
    with ProgressDisplay(stream) as display:
        for step in STEPS:
            display(step)
    text = stream.getvalue()
    assert "compiling kernels for this scene (once; cached)..." in text
    assert "compiled in 12.3 s" in text
    assert "0 s left, 2.0 Msamples/s" in text
    assert "\x1b[?25h" in text  # the cursor is back


def test_without_a_terminal_there_are_plain_lines():
    """No escape sequence, no carriage return; a line every ten seconds."""
    stream = io.StringIO()
    with ProgressDisplay(stream) as display:
        for step in STEPS:
            display(step)
    assert stream.getvalue().splitlines() == [
        "compiling kernels for this scene (once; cached)...",
        "compiled in 12.3 s",
        "rendering 40000000 samples",
        "25%, 30 s left, 1.0 Msamples/s",
        "100%, 0 s left, 2.0 Msamples/s",
    ]


@pytest.mark.parametrize("begins", [(1e-6,), (1e-6, 0.05, 0.1)])
def test_each_render_is_announced_once_and_shown_to_its_end(begins):
    """As for the AOVs and the colours of one picture; the first jobs may take a while."""
    stream = io.StringIO()
    display = ProgressDisplay(stream)
    for later in (0.0, 1e-6):  # the second render is first heard of a little later
        for seconds in begins:
            display(Progress("render", 0, 400, seconds + later))
        display(Progress("render", 400, 400, 20.0))
    one = ["rendering 400 samples", "100%, 0 s left, 20 samples/s"]
    assert stream.getvalue().splitlines() == [*one, *one]


# ------------------------------------------------------------------------- interrupts


def test_ctrl_c_writes_the_picture_so_far(start):
    """From outside, as a terminal sends it, into a render without end."""
    process = start(*ENDLESS, "-o", "a.exr")
    wait_for(process, "rendering")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    found = re.fullmatch(r"interrupted (after (\d+) of (\d+) samples); wrote a.exr\n", err)
    assert found is not None
    done, samples = int(found[2]), int(found[3])
    assert 0 <= done < samples == 64 * 64 * 4000000
    assert header("a.exr")["interrupted"] == found[1]
    assert np.isfinite(pixels("a.exr")).all()


def test_ctrl_c_while_compiling_quits_at_once(tmp_path, start):
    """There is no picture to write; an empty cache makes it compile."""
    process = start(*ENDLESS, "-o", "a.exr", LIGHTPROOF_CACHE=str(tmp_path / "cache"))
    wait_for(process, "compiling")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (130, "", "interrupted; wrote nothing\n")
    assert not Path("a.exr").exists()


def interrupt_after(monkeypatch, samples, times):
    """Send SIGINT so many times once so many samples are done."""
    show = ProgressDisplay.__call__

    def call(self, progress):
        show(self, progress)
        if progress.stage == "render" and progress.done >= samples:
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(ProgressDisplay, "__call__", call)


def test_the_picture_so_far_is_that_of_the_samples_so_far(capsys, monkeypatch):
    """In one tile jobs follow each other: the same bits as a render of fewer samples."""
    small = [CORNELL, "-D", "width=32", "-D", "height=32"]
    with monkeypatch.context() as context:
        interrupt_after(context, samples=1, times=1)
        assert main([*small, "--spp", "4000000", "-o", "part.exr"]) == 130
    done = int(re.search(r"after (\d+) of", capsys.readouterr().err)[1])
    spp, rest = divmod(done, 32 * 32)
    assert rest == 0
    assert main([*small, "--spp", str(spp), "-o", "whole.exr"]) == 0
    np.testing.assert_array_equal(pixels("part.exr"), pixels("whole.exr"))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_quits_without_the_picture(capsys, monkeypatch):
    interrupt_after(monkeypatch, samples=1, times=2)
    assert main([*ENDLESS, "-o", "a.exr"]) == 130
    assert capsys.readouterr().err.endswith("interrupted; wrote nothing\n")
    assert not list(Path().iterdir())


def test_ctrl_c_while_writing_waits_for_the_file(capsys, monkeypatch):
    """The picture is whole by then; the status still says that it was interrupted."""
    save = Image.save

    def interrupted_save(self, path):
        signal.raise_signal(signal.SIGINT)
        save(self, path)

    monkeypatch.setattr(Image, "save", interrupted_save)
    assert main([*SMALL, "-o", "a.exr"]) == 130
    assert capsys.readouterr().out.endswith("; wrote a.exr\n")
    assert "interrupted" not in header("a.exr")


def without_kernels(monkeypatch, value):
    """Let each job take a moment and add `value(first sample)` to all sums of its tiles."""

    def render(self, sums, tiles, first_sample, end_sample, thread):
        time.sleep(2e-4)
        sums += value(first_sample)

    monkeypatch.setattr(RenderJob, "_render", render)


class Alarm:
    """Raises KeyboardInterrupt once, anywhere in Python's code, as Ctrl-C does."""

    def __enter__(self):
        self.armed = False
        self.previous = signal.signal(signal.SIGALRM, self.ring)
        return self

    def __exit__(self, *error):
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self.previous)

    def set(self, seconds):
        self.armed = True
        signal.setitimer(signal.ITIMER_REAL, seconds)

    def ring(self, number, frame):
        if self.armed:
            self.armed = False
            raise KeyboardInterrupt


@pytest.mark.usefixtures("no_collection")
def test_an_interrupt_at_any_moment_counts_no_job_twice(monkeypatch):
    """What users of the API meet, at forty moments spread over a render.

    Job k of a tile adds 4^k to its pixels, so that a sum in base 4 shows how often each
    job was added: never, or once.
    """
    scene = renderer.load_file(CORNELL, width=64, height=64)
    plan = make_plan(scene, spp=12 * SAMPLES_PER_JOB)
    without_kernels(monkeypatch, lambda first: 4.0 ** (first // SAMPLES_PER_JOB))
    outcomes = set()
    for moment in range(1, 41):
        job = RenderJob(scene, plan, RenderOptions(threads=2))
        film = job.make_film()
        with Alarm() as alarm:
            try:
                alarm.set(moment * 4e-4)
                complete = run(job, film).complete
                alarm.armed = False
            except KeyboardInterrupt:  # before the first job, or after the last one
                continue
        outcomes.add(complete)
        tiles = len(film.tiles)
        layers = film.sums.reshape(-1, tiles, *film.sums.shape[1:])
        for weight in np.unique(layers.sum(axis=0)):
            digits = np.base_repr(int(weight), 4)
            assert set(digits) <= {"0", "1"}
            assert not complete or digits == 12 * "1"
    assert False in outcomes  # otherwise nothing was tested


def test_ctrl_c_before_the_colours_of_an_aov_keeps_the_aovs(monkeypatch):
    """The nested integrator renders after them; what was done by then is not lost."""
    without_kernels(monkeypatch, lambda first: 1.0)
    scene = renderer.load_file(
        SCENES / "depth-and-normals" / "scene.xml", width=32, height=24
    )
    starts = []

    def progress(now):
        if now.stage == "render" and now.done == 0:
            starts.append(now)
            if len(starts) == 2:
                raise KeyboardInterrupt

    image = renderer.render(scene, progress=progress)
    assert not image.complete
    assert (image.aovs["depth"] == 1.0).all()
    assert image.metadata["interrupted"] == "after 0 of 768 samples"


@pytest.mark.parametrize(
    "error", [NotAllowed("no memory"), ClusterError("no worker"), KeyboardInterrupt()]
)
def test_colours_that_cannot_start_leave_the_aovs(monkeypatch, error):
    without_kernels(monkeypatch, lambda first: 1.0)
    scene = renderer.load_file(
        SCENES / "depth-and-normals" / "scene.xml", width=32, height=24
    )
    begin = road.begin

    def refusing(of, *arguments):
        if of is not scene:
            raise error
        return begin(of, *arguments)

    monkeypatch.setattr(road, "begin", refusing)
    image = renderer.render(scene)
    assert not image.complete and (image.aovs["depth"] == 1.0).all()
    said = image.metadata["interrupted"]
    assert said.startswith("before the first sample of the colours")
    assert said.endswith(str(error))
