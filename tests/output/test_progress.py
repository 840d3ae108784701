"""Progress as lines of JSON, and nothing where nobody looks."""

import json
import logging
import re
import time

import pytest

from fifesim.base.messages import quiet
from fifesim.output import progress
from fifesim.output.progress import Progress, doing, since_start, steps


def test_lines_say_where_the_run_is(capsys):
    with Progress("simulating", "cells", 100, done=40, as_json=True) as progress:
        progress.advance(60)
    first, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["cells_done"], first["seconds_left"]) == (40, None)
    assert (last["cells_done"], last["cells"], last["seconds_left"]) == (100, 100, 0)
    assert last["cells_per_second"] > 0 and last["memory"] > 10e6


def test_a_line_a_minute_says_where_the_run_is_without_a_terminal(capsys, monkeypatch):
    now = iter(range(0, 10**6, 25))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now)))
    with Progress("simulating", "cells", 8_000_000) as progress:
        for _ in range(8):
            progress.advance(1_000_000)
    out, err = capsys.readouterr()
    assert out == "" and 2 <= len(err.splitlines()) <= 5
    line = r"simulating: \d,000,000 of 8,000,000 cells, \d\d,\d{3}\.\d/s, \d+\.\d+ GB, .* left$"
    assert re.match(line, err.splitlines()[0]), err


def test_time_since_start_counts_from_the_start_of_the_process(monkeypatch):
    monkeypatch.setattr(progress.psutil.Process, "create_time", lambda process: 1000.0)
    monkeypatch.setattr(time, "time", lambda: 1030.0)
    assert since_start() == 30.0


def test_nothing_is_printed_of_a_short_run_without_a_terminal(capsys):
    with Progress("simulating", "cells", 2) as progress:
        progress.advance(2)
    assert list(steps([1, 2], "counting")) == [1, 2]
    with doing("a report"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("widgets", "shown"), [(True, True), (False, False)])
def test_a_notebook_shows_bars_where_it_has_widgets(monkeypatch, widgets, shown):
    """A notebook's standard error is no terminal; what rich draws there are widgets."""
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr(progress, "find_spec", lambda name: widgets or None)
    assert progress._shows_bars() == shown
    with quiet():
        assert not progress._shows_bars()


def test_steps_are_logged(caplog):
    with caplog.at_level(logging.DEBUG, logger="fifesim"):
        assert list(steps(["a", "b"], "scenes")) == ["a", "b"]
    assert caplog.messages == ["scenes: 2", "scenes: 1 of 2", "scenes: 2 of 2"]
