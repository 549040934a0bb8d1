"""Threads that share a row of jobs: every job once, in the requested order."""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from pathlib import Path

import pytest
from processes import run_python

from renderer.process.worker_pool import STACK, WorkerPool, in_own_thread, in_threads

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("threads", [1, 2, 7])
@pytest.mark.parametrize("jobs", [0, 1, 5, 1000])
def test_every_job_is_done_once(threads, jobs):
    done: list[int] = []
    in_threads(threads, jobs, done.append)
    assert sorted(done) == list(range(jobs))


@pytest.mark.parametrize("round_length", [1, 2, 3, 10])
def test_a_job_waits_for_the_one_a_round_before(round_length):
    """Also beyond 256 rounds, and with more threads than jobs in a round."""
    ended: set[int] = set()
    early: list[int] = []

    def work(job, thread):
        if job >= round_length and job - round_length not in ended:
            early.append(job)
        if job % 37 == 0:
            time.sleep(1e-3)
        ended.add(job)

    crew = WorkerPool(4, 300 * round_length, work, round_length)
    crew.start()
    while not crew.wait():
        pass
    assert not early and len(ended) == 300 * round_length


def test_a_thread_has_its_number_for_itself():
    at_work: set[int] = set()

    def work(job, thread):
        assert thread not in at_work
        at_work.add(thread)
        time.sleep(1e-4)
        at_work.remove(thread)

    crew = WorkerPool(3, 200, work)
    crew.start()
    while not crew.wait():
        pass
    assert crew.done == 200


def test_an_error_ends_the_others_and_is_raised():
    """Also where others wait for the job that failed."""
    done: list[int] = []

    def work(job, thread):
        if job == 10:
            raise ValueError("the eleventh job")
        done.append(job)

    crew = WorkerPool(3, 10**6, work, round_length=2)
    crew.start()
    with pytest.raises(ValueError, match="eleventh"):
        while not crew.wait():
            pass
    crew.stop()
    assert len(done) < 100
    with pytest.raises(ZeroDivisionError):
        in_threads(2, 5, lambda job: 1 // (job - 3))


def test_stopped_threads_end_what_they_are_at():
    begun, ended = [], []
    first = threading.Event()

    def work(job, thread):
        begun.append(job)
        first.set()
        time.sleep(0.02)
        ended.append(job)

    crew = WorkerPool(2, 10**6, work)
    crew.start()
    first.wait()
    crew.stop()
    assert sorted(begun) == sorted(ended)
    number = len(begun)
    time.sleep(0.03)
    assert len(begun) == number <= 4


def test_a_stop_does_not_wait_for_a_job_that_was_never_begun():
    """A thread takes job 0 and is stopped before it begins; another waits for that job."""
    crew = WorkerPool(2, 4, lambda job, thread: None, round_length=2)
    crew._at_work[1] = True
    waiting = threading.Thread(target=lambda: waited.append(crew._may_begin(2)))
    waited: list[bool] = []
    waiting.start()
    crew._stopped = True
    waiting.join(timeout=10)
    assert waited == [False]


@pytest.mark.usefixtures("no_collection")
def test_an_interrupt_at_any_moment_ends_it_and_leaves_no_job_half_done(monkeypatch):
    """Four hundred moments: never a wait without end, a job lost, or one done twice.

    With `concurrent.futures` 17 of 3862 renders that were interrupted waited for ever.
    """

    def ring(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, ring)
    interrupted = 0
    try:
        for moment in range(1, 401):
            done = [0] * 400

            def work(job, thread, done=done):
                done[job] += 1

            crew = WorkerPool(2, 400, work)
            try:
                signal.setitimer(signal.ITIMER_REAL, moment * 5e-6)
                try:
                    crew.start()
                    while not crew.wait():
                        pass
                finally:
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
            except KeyboardInterrupt:
                interrupted += 1
            crew.stop()
            assert max(done) <= 1
            assert sum(done) == crew.done
    finally:
        signal.signal(signal.SIGALRM, before)
    assert interrupted


_LITTLE_STACK = """
import os, resource, sys
_, most = resource.getrlimit(resource.RLIMIT_STACK)
resource.setrlimit(resource.RLIMIT_STACK, (512 << 10, most))
os.execv(sys.executable, [sys.executable, "-m", "renderer", *sys.argv[1:]])
"""


def test_a_small_stack_holds_the_kernels(tmp_path):
    """As after `ulimit -s 512`: rays through instances take 0.7 MiB, and it crashed.

    Half of the 1024 where they just fit.
    """
    scene = str(ROOT / "scenes" / "instances" / "scene.xml")
    words = ["-D", "width=16", "-D", "height=16", "--spp", "1", "-o", "a.npy", scene]
    run_python(
        "-c",
        _LITTLE_STACK,
        *words,
        folder=tmp_path,
        environment={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True,
    )
    assert (tmp_path / "a.npy").exists()


def test_only_threads_for_kernels_have_their_stack(monkeypatch):
    """Those of a cluster's worker too, whose own threads have what Dask gives them."""
    start, sizes = _thread.start_new_thread, []

    def noted(*given):
        sizes.append(_thread.stack_size(STACK))
        return start(*given)

    monkeypatch.setattr(_thread, "start_new_thread", noted)
    usual = 1 << 20
    before = _thread.stack_size(usual)
    in_threads(2, 2, lambda job: None)
    in_own_thread(lambda: None)
    after = _thread.stack_size(before)  # to ask is to set
    assert sizes == [STACK] * 3 and after == usual


def test_crews_that_start_at_once_leave_the_stacks_size_alone(monkeypatch):
    """Nobody sets it for the process between another one's setting and restoring."""
    set_size, calls = _thread.stack_size, []

    def noted(size):
        calls.append(_thread.get_ident())
        before = set_size(size)
        time.sleep(0.001)  # another thread may come between
        return before

    monkeypatch.setattr(_thread, "stack_size", noted)
    crews = [WorkerPool(4, 4, lambda job, thread: None) for _ in range(4)]
    starters = [threading.Thread(target=crew.start) for crew in crews]
    for starter in starters:
        starter.start()
    for starter in starters:
        starter.join()
    for crew in crews:
        crew.stop()
    assert len(calls) == 2 * 4 * len(crews)
    assert calls[::2] == calls[1::2]  # set and restored by the same


def test_an_error_in_a_thread_of_its_own_is_raised_here():
    with pytest.raises(ZeroDivisionError):
        in_own_thread(lambda: 1 / 0)
