"""Progress of a run: a bar on a terminal or in a notebook, JSON lines for batch systems, else a line per minute."""

import json
import math
import sys
import time
from collections import deque
from contextlib import contextmanager
from datetime import timedelta
from importlib.util import find_spec
from operator import length_hint

import psutil
from numba.core import event
from rich import progress
from rich.console import Console
from rich.text import Text

from fifesim.base.messages import LOG, is_quiet

# Interval between JSON lines, and between text lines without a terminal; time over which the rate is averaged. [s]
_PAUSE, _LONG_PAUSE, _WINDOW = 1.0, 60.0, 10.0

# Width of a bar, which leaves room for the numbers in a terminal of 80 columns. [character]
_BAR = 22


class _Compilation(event.Listener):
    """Number of kernels that numba compiles at the moment, and the time at which the last one was finished. [s]"""

    active, end = 0, -math.inf

    def on_start(self, event):
        self.active += 1

    def on_end(self, event):
        self.active, self.end = self.active - 1, time.monotonic()


_COMPILATION = _Compilation()
event.register("numba:compile", _COMPILATION)


class _Label(progress.ProgressColumn):
    """Description of the work, or that kernels are compiled for it."""

    def render(self, task):
        return Text("compiling (once)" if _COMPILATION.active else task.description)


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
        self._done, self._last_report, self._last_line = done, -_PAUSE, time.monotonic()
        # Times and numbers done, the first of which begin the window of the rate.
        self._samples = deque([(self._last_line, done)])
        numbers = [progress.TextColumn(f"{{task.fields[{each}]}}") for each in ("amount", "rate", "left")]
        self._bar = _bar(_Label(), progress.BarColumn(_BAR), progress.TaskProgressColumn(), *numbers, disable=as_json)
        amount = f"{_short(total)} {counted}"
        self._task = self._bar.add_task(label, total=total, completed=done, amount=amount, rate="", left="")

    def __enter__(self):
        self._bar.start()
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        return self

    def __exit__(self, *error):
        self._bar.stop()

    def advance(self, number):
        """Report that more is done."""
        now = time.monotonic()
        if self._samples[0][0] < _COMPILATION.end <= now:
            self._samples = deque([(_COMPILATION.end, self._done)])
        self._done += number
        self._samples.append((now, self._done))
        while len(self._samples) > 2 and self._samples[1][0] <= now - _WINDOW:
            self._samples.popleft()
        if now - self._last_report < _PAUSE and self._done < self._total:
            return
        self._last_report = now
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        elif not self._bar.disable:
            rate, left = self._rate_and_time_left()
            self._bar.update(self._task, completed=self._done, rate=f"{_short(rate)}/s", left=left)
        elif now - self._last_line >= _LONG_PAUSE and not is_quiet():
            self._last_line, (rate, left) = now, self._rate_and_time_left()
            amount = f"{_short(self._done)} of {_short(self._total)} {self._counted}"
            line = f"{self._label}: {amount}, {_short(rate)}/s, {memory() / 1e9:.2f} GB, {left}"
            print(line, file=sys.stderr, flush=True)

    def _rate(self):
        """Rate of the last seconds, without the time of compilation before."""
        (start, before), (end, done) = self._samples[0], self._samples[-1]
        return (done - before) / max(end - start, 1e-9)

    def _rate_and_time_left(self):
        rate = self._rate()
        left = timedelta(seconds=round((self._total - self._done) / rate)) if rate else None
        return rate, "" if left is None else f"{str(left).removeprefix('0:')} left"

    def state(self):
        """State of the progress: number done, rate, seconds left and memory [byte]."""
        rate = self._rate()
        return {
            "event": "progress",
            f"{self._counted}_done": self._done,
            self._counted: self._total,
            f"{self._counted}_per_second": round(rate, 1),
            "seconds_left": round((self._total - self._done) / rate, 1) if rate else None,
            "memory": memory(),
        }


def _short(number):
    """A number with at most one decimal of thousands, millions or billions."""
    factor, unit = next((each for each in ((1e9, " G"), (1e6, " M"), (1e3, " k")) if number >= each[0]), (1, ""))
    # Half is rounded up.
    return f"{math.floor(10 * number / factor + 0.5) / 10:g}{unit}"


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
    with _bar(progress.SpinnerColumn(), _Label(), progress.TimeElapsedColumn()) as bar:
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
