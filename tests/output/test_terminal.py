"""Terminal output of commands: results, errors, progress, and no output without a terminal."""

import json
import logging
import os
import re
import signal
import time

import pytest

from fifesim.base.messages import quiet
from fifesim.output import progress
from fifesim.output.progress import Progress, since_start, spinner, steps
from fifesim.output.terminal import Exit, exit_with_error, in_time, interrupts_blocked, print_lines, report


def test_last_line_gives_the_duration_and_the_file_to_open(capsys):
    report(["out/image.tif"], 75.2, "out/report.html in a browser")
    assert capsys.readouterr().out.splitlines() == [
        "out/image.tif",
        "done in 1 min 15 s: open out/report.html in a browser",
    ]
    with quiet():
        report(["out/image.tif"], 75.2, "out/report.html")
    assert capsys.readouterr().out == ""


def test_durations_never_show_60_seconds_or_60_minutes():
    assert [in_time(seconds) for seconds in (0.04, 59.94, 59.96, 3599.6)] == [
        "0.0 s",
        "59.9 s",
        "1 min 0 s",
        "1 h 0 min",
    ]


def test_control_characters_are_escaped(capsys):
    print_lines("one\x1b[31m", "two\nthree")
    assert capsys.readouterr().out == "one\\x1b[31m\ntwo\nthree\n"


@pytest.mark.parametrize("code", Exit)
def test_error_gives_its_exit_code_and_at_most_500_characters(code, capsys):
    with pytest.raises(SystemExit) as caught:
        exit_with_error(ValueError("x" * 2000), code)
    assert caught.value.code == code
    said = capsys.readouterr().err
    assert said.startswith("fifesim: xxx") and len(said) <= 501


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be blocked on Windows")
def test_interrupt_is_delayed_until_the_context_ends():
    done, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), interrupts_blocked():
            os.kill(os.getpid(), signal.SIGINT)
            done.append("rest")
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == ["rest"] and signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_json_lines_report_progress(capsys):
    with Progress("simulating", "cells", 100, done=40, as_json=True) as progress:
        progress.advance(60)
    first, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["cells_done"], first["seconds_left"]) == (40, None)
    assert (last["cells_done"], last["cells"], last["seconds_left"]) == (100, 100, 0)
    assert last["cells_per_second"] > 0 and last["memory"] > 10e6


def test_progress_is_one_line_per_minute_without_a_terminal(capsys, monkeypatch):
    now = iter(range(0, 10**6, 25))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now)))
    with Progress("simulating", "cells", 8_000_000) as progress:
        for _ in range(8):
            progress.advance(1_000_000)
    out, err = capsys.readouterr()
    assert out == "" and 2 <= len(err.splitlines()) <= 5
    line = r"simulating: \d,000,000 of 8,000,000 cells, \d\d,\d{3}\.\d/s, \d+\.\d+ GB, .* left$"
    assert re.match(line, err.splitlines()[0]), err


def test_short_run_without_a_terminal_prints_nothing_but_a_log(capsys, caplog):
    with Progress("simulating", "cells", 2) as progress:
        progress.advance(2)
    with caplog.at_level(logging.DEBUG, logger="fifesim"):
        assert list(steps(["a", "b"], "scenes")) == ["a", "b"]
    # A test before may have set the level of the logger, so that the spinner logs too.
    assert caplog.messages == ["scenes: 2", "scenes: 1 of 2", "scenes: 2 of 2"]
    with spinner("a report"):
        pass
    assert capsys.readouterr() == ("", "")


def test_elapsed_time_counts_from_the_start_of_the_process(monkeypatch):
    monkeypatch.setattr(progress.psutil.Process, "create_time", lambda process: 1000.0)
    monkeypatch.setattr(time, "time", lambda: 1030.0)
    assert since_start() == 30.0
