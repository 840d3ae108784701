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


class Progress:
    """Progress of work on cells or chips, some of which are done already, as a context manager around the work."""

    # JSON has up to one line per second on standard output; text is a bar, or a line per minute on standard error.
    def __init__(self, label, counted, total, done=0, as_json=False):
        self._label, self._counted, self._total, self._as_json = label, counted, total, as_json
        self._before, self._done = done, done
        self._start, self._last_report = time.monotonic(), -_PAUSE
        self._last_line = self._start
        rate = progress.TextColumn("{task.fields[rate]}")
        columns = _LABEL, progress.BarColumn(), progress.TaskProgressColumn(), rate, progress.TimeRemainingColumn()
        self._bar = _bar(*columns, disable=as_json)
        self._task = self._bar.add_task(label, total=total, completed=done, rate="")

    def __enter__(self):
        self._bar.start()
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        return self

    def __exit__(self, *error):
        self._bar.stop()

    def advance(self, number):
        """Report that more is done."""
        self._done += number
        now = time.monotonic()
        if now - self._last_report < _PAUSE and self._done < self._total:
            return
        self._last_report = now
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        elif not self._bar.disable:
            self._bar.update(self._task, completed=self._done, rate=self._in_words(self.state()))
        elif now - self._last_line >= _LONG_PAUSE and not is_quiet():
            self._last_line, state = now, self.state()
            left = f", {format_time(state['seconds_left'])} left" if state["seconds_left"] else ""
            print(f"{self._label}: {self._in_words(state)}{left}", file=sys.stderr, flush=True)

    def _in_words(self, state):
        rate, used = state[f"{self._counted}_per_second"], state["memory"] / 1e9
        return f"{self._done:,} of {self._total:,} {self._counted}, {rate:,.1f}/s, {used:.2f} GB"

    def state(self):
        """State of the progress: number done, rate, seconds left and memory [byte]."""
        rate = (self._done - self._before) / max(time.monotonic() - self._start, 1e-9)
        return {
            "event": "progress",
            f"{self._counted}_done": self._done,
            self._counted: self._total,
            f"{self._counted}_per_second": round(rate, 1),
            "seconds_left": round((self._total - self._done) / rate, 1) if rate else None,
            "memory": memory(),
        }


def steps(sequence, label):
    """Iterate over a sequence with a progress bar on a terminal or in a notebook."""
    total = length_hint(sequence)
    LOG.info("%s: %d", label, total)
    shown = progress.track(sequence, label, console=Console(file=sys.stderr), disable=not _shows_bars(), transient=True)
    for number, item in enumerate(shown, 1):
        yield item
        LOG.debug("%s: %d of %d", label, number, total)


@contextmanager
def spinner(label):
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
