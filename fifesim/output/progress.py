"""Progress of a run: a bar on a terminal or in a notebook, JSON lines for batch systems, else a line per minute."""

import json
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec
from operator import length_hint

import psutil
from dask.utils import format_time
from rich import progress
from rich.console import Console

from fifesim.base.messages import LOG, is_quiet

_LABEL = progress.TextColumn("{task.description}")

# Interval between JSON lines, and between text lines without a terminal. [s]
_PAUSE, _LONG_PAUSE = 1.0, 60.0


def since_start():
    """Time since this process was started, imports included. [s]"""
    return time.time() - psutil.Process().create_time()


def memory():
    """Resident memory of this process and its children. [byte]"""
    here = psutil.Process()
    total = 0
    for process in (here, *here.children(recursive=True)):
        try:
            total += process.memory_info().rss
        except psutil.Error:
            # A child that has just ended.
            continue
    return total


class CellProgress:
    """Progress of cells, of which an earlier run has done some, as a context manager around the work."""

    # JSON has up to one line per second on standard output; text is a bar, or a line per minute on standard error.
    # Work and its counted units; decimals of the rate in JSON, and the text of a line with its scale.
    label, counted, decimals = "simulating", "cells", None
    text, scale = "{done:.1f} of {cells:.1f} million cells, {rate:.1f} million/s", 1e6

    def __init__(self, cells, done=0, as_json=False):
        self._cells, self._before, self._done, self._as_json = cells, done, done, as_json
        self._start, self._last_report = time.monotonic(), -_PAUSE
        self._last_line = self._start
        columns = (
            _LABEL,
            progress.BarColumn(),
            progress.TaskProgressColumn(),
            progress.TextColumn("{task.fields[rate]}"),
        )
        self._bar = _bar(*columns, progress.TimeRemainingColumn(), disable=as_json)
        self._task = self._bar.add_task(self.label, total=cells, completed=done, rate="")

    def __enter__(self):
        self._bar.start()
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        return self

    def __exit__(self, *error):
        self._bar.stop()

    def advance(self, cells):
        """Report that more cells are done."""
        self._done += cells
        now = time.monotonic()
        if now - self._last_report < _PAUSE and self._done < self._cells:
            return
        self._last_report = now
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        elif not self._bar.disable:
            self._bar.update(self._task, completed=self._done, rate=self._in_words(self.state()))
        elif now - self._last_line >= _LONG_PAUSE and not is_quiet():
            self._last_line, state = now, self.state()
            left = f", {format_time(state['seconds_left'])} left" if state["seconds_left"] else ""
            print(f"{self.label}: {self._in_words(state)}{left}", file=sys.stderr, flush=True)

    def _in_words(self, state):
        done, cells, rate = (state[f"{self.counted}{each}"] / self.scale for each in ("_done", "", "_per_second"))
        return f"{self.text.format(done=done, cells=cells, rate=rate)}, {state['memory'] / 1e9:.2f} GB"

    def state(self):
        """State of the progress: cells, rate, seconds left and memory [byte]."""
        elapsed = max(time.monotonic() - self._start, 1e-9)
        rate = (self._done - self._before) / elapsed
        left = (self._cells - self._done) / rate if rate else None
        return {
            "event": "progress",
            f"{self.counted}_done": self._done,
            self.counted: self._cells,
            f"{self.counted}_per_second": round(rate, self.decimals),
            "seconds_left": None if left is None else round(left, 1),
            "memory": memory(),
        }


class ChipProgress(CellProgress):
    """Progress of chips, as `CellProgress` for cells."""

    label, counted, decimals = "making chips", "chips", 1
    text, scale = "{done:.0f} of {cells:.0f} chips, {rate:.1f}/s", 1


def steps(sequence, label):
    """Iterate over a sequence with a progress bar on a terminal or in a notebook."""
    total = length_hint(sequence)
    LOG.info("%s: %d", label, total)
    shown = progress.track(sequence, label, console=Console(file=sys.stderr), disable=not _shows_bars(), transient=True)
    for number, item in enumerate(shown, 1):
        yield item
        LOG.debug("%s: %d of %d", label, number, total)


@contextmanager
def doing(label):
    """Context with a spinner on a terminal or in a notebook, for work of unknown length."""
    LOG.info(label)
    with _bar(progress.SpinnerColumn(), _LABEL, progress.TimeElapsedColumn()) as bar:
        bar.add_task(label)
        yield


def _bar(*columns, disable=False):
    """Progress bar on standard error that disappears at its end."""
    console = Console(file=sys.stderr)
    return progress.Progress(*columns, console=console, disable=disable or not _shows_bars(), transient=True)


def _shows_bars():
    """Whether a terminal or a notebook shows bars; a notebook needs ipywidgets."""
    if is_quiet():
        return False
    return sys.stderr.isatty() or (Console().is_jupyter and find_spec("ipywidgets") is not None)
