"""Progress as JSON lines, and no output without a terminal."""

import json
import logging
import re
import time

import pytest

from fifesim.base.messages import quiet
from fifesim.output import progress
from fifesim.output.progress import Progress, since_start, spinner, steps


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


def test_elapsed_time_counts_from_the_start_of_the_process(monkeypatch):
    monkeypatch.setattr(progress.psutil.Process, "create_time", lambda process: 1000.0)
    monkeypatch.setattr(time, "time", lambda: 1030.0)
    assert since_start() == 30.0


def test_short_run_without_a_terminal_prints_nothing(capsys):
    with Progress("simulating", "cells", 2) as progress:
        progress.advance(2)
    assert list(steps([1, 2], "counting")) == [1, 2]
    with spinner("a report"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("widgets", "shown"), [(True, True), (False, False)])
def test_notebook_shows_bars_if_widgets_are_available(monkeypatch, widgets, shown):
    """The standard error of a notebook is no terminal; rich draws widgets there."""
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr(progress, "find_spec", lambda name: widgets or None)
    assert progress._shows_bars() == shown
    with quiet():
        assert not progress._shows_bars()


def test_steps_are_logged(caplog):
    with caplog.at_level(logging.DEBUG, logger="fifesim"):
        assert list(steps(["a", "b"], "scenes")) == ["a", "b"]
    assert caplog.messages == ["scenes: 2", "scenes: 1 of 2", "scenes: 2 of 2"]
