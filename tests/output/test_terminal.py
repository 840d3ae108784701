"""Terminal output of commands: results, errors, progress, and no output without a terminal."""

import io
import json
import logging
import os
import re
import signal
import time
from types import SimpleNamespace

import pytest
from numba.core import event
from rich.console import Console

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
    line = r"simulating: \d M of 8 M cells, 40 k/s, \d+\.\d+ GB, 0\d:\d\d left$"
    assert re.match(line, err.splitlines()[0]), err


@pytest.fixture
def terminal(monkeypatch):
    """Text of a terminal of 80 columns on which progress is shown, and a clock that the test sets."""
    shown, clock = io.StringIO(), SimpleNamespace(now=0.0)
    console = Console(
        file=shown, force_terminal=True, color_system="standard", width=80, height=24, legacy_windows=False
    )
    monkeypatch.setattr(progress, "Console", lambda **how: console)
    monkeypatch.setattr(progress, "_shows_bars", lambda: True)
    monkeypatch.setattr(time, "monotonic", lambda: clock.now)
    return shown, clock


def last_line(shown, bar):
    """Line of the bar as it is now."""
    shown.seek(0)
    shown.truncate()
    bar.refresh()
    return re.sub(r"\x1b\[[\d;?]*[A-Za-z]|[\r\n]", "", shown.getvalue())


def test_bar_fits_into_80_columns(terminal):
    """The rate is that of the last seconds, so that neither imports nor compilation count, and no text is cut."""
    shown, clock = terminal
    with Progress("simulating", "cells", 20_250_000) as work:
        clock.now = 30.0
        event.start_event("numba:compile")
        event.start_event("numba:compile")
        event.end_event("numba:compile")
        line = last_line(shown, work._bar)
        assert line.startswith("compiling (once) ━") and "20.3 M cells" in line
        clock.now = 40.0
        event.end_event("numba:compile")
        for _ in range(8):
            clock.now += 1.0
            work.advance(1_250_000)
        line = last_line(shown, work._bar)
        assert re.fullmatch(r"simulating [━╸╺]{20,}  49% 20\.3 M cells 1\.3 M/s 00:08 left *", line), line
        assert "…" not in line and len(line) <= 80
        # Ten seconds later, the rate before is forgotten.
        for _ in range(12):
            clock.now += 1.0
            work.advance(100_000)
        assert " 100 k/s 01:30 left" in last_line(shown, work._bar)


def test_longest_texts_of_a_bar_fit_into_80_columns(terminal):
    shown, clock = terminal
    event.start_event("numba:compile")
    with Progress("simulating", "cells", 999_900_000) as work:
        clock.now = 1.0
        work.advance(999_900)
        line = last_line(shown, work._bar)
    event.end_event("numba:compile")
    assert re.fullmatch(r"compiling \(once\) [━╸╺]{20,}   0% 999\.9 M cells 999\.9 k/s 16:39 left *", line), line
    assert len(line) <= 80


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
