"""How far a run is: a bar on a terminal or in a notebook, lines of JSON for batch systems, else a line a minute."""

import json
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec
from operator import length_hint

import psutil
from dask.utils import format_time
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
    track,
)

from fifesim.base.logs import LOG, is_quiet

# Between two lines of JSON, and between two in words where no terminal shows a bar. [s]
_PAUSE, _LONG_PAUSE = 1.0, 60.0


def since_start():
    """
    Time since this process began, which began with imports.

    Returns
    -------
    seconds : float
    """
    return time.time() - psutil.Process().create_time()


def memory():
    """
    Resident memory of this process and of those that it started.

    Returns
    -------
    memory : int
        [byte]
    """
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
    """
    Count of cells done; a context manager around the work.

    Parameters
    ----------
    cells : int
        In all.
    done : int, optional
        Of them from an earlier run.
    as_json : bool, optional
        One line of JSON a second at most, on standard output, instead of a bar on a terminal, or a line a minute on
        standard error where that is none.
    """

    # What is done, the word for what is counted, and decimals of how many a second.
    label, counted, decimals = "simulating", "cells", None

    def __init__(self, cells, done=0, as_json=False):
        self._cells, self._before, self._done, self._as_json = cells, done, done, as_json
        self._start, self._said = time.monotonic(), -_PAUSE
        self._told = self._start
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[said]}"),
            TimeRemainingColumn(),
            console=Console(file=sys.stderr),
            disable=as_json or not _shows_bars(),
            transient=True,
        )
        self._task = self._bar.add_task(self.label, total=cells, completed=done, said="")

    def __enter__(self):
        self._bar.start()
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        return self

    def __exit__(self, *error):
        self._bar.stop()

    def advance(self, cells):
        """
        Say that more cells are done.

        Parameters
        ----------
        cells : int
        """
        self._done += cells
        now = time.monotonic()
        if now - self._said < _PAUSE and self._done < self._cells:
            return
        self._said = now
        if self._as_json:
            print(json.dumps(self.state()), flush=True)
        elif not self._bar.disable:
            self._bar.update(self._task, completed=self._done, said=self._in_words(self.state()))
        elif now - self._told >= _LONG_PAUSE and not is_quiet():
            self._told, state = now, self.state()
            left = f", {format_time(state['seconds_left'])} left" if state["seconds_left"] else ""
            print(f"{self.label}: {self._in_words(state)}{left}", file=sys.stderr, flush=True)

    def _in_words(self, state):
        rate = state[f"{self.counted}_per_second"]
        return f"{self._counted_in_words(rate)}, {state['memory'] / 1e9:.2f} GB"

    def _counted_in_words(self, rate):
        return f"{self._done / 1e6:.1f} of {self._cells / 1e6:.1f} million cells, {rate / 1e6:.1f} million/s"

    def state(self):
        """
        Where the run is.

        Returns
        -------
        state : dict
            ``cells_done``, ``cells``, ``cells_per_second``, ``seconds_left`` and ``memory`` [byte].
        """
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
    """Count of chips done, as `CellProgress` counts cells."""

    label, counted, decimals = "making chips", "chips", 1

    def _counted_in_words(self, rate):
        return f"{self._done} of {self._cells} chips, {rate:.1f}/s"


def steps(sequence, label):
    """
    Go through a sequence and show how far it is, on a terminal or in a notebook.

    Parameters
    ----------
    sequence : sequence
    label : str
        What is being done.

    Returns
    -------
    sequence : iterator
    """
    total = length_hint(sequence)
    LOG.info("%s: %d", label, total)
    console = Console(file=sys.stderr)
    for number, each in enumerate(
        track(sequence, label, console=console, disable=not _shows_bars(), transient=True), 1
    ):
        yield each
        LOG.debug("%s: %d of %d", label, number, total)


@contextmanager
def doing(label):
    """
    A context around work of unknown length, which a terminal or a notebook shows going on.

    Parameters
    ----------
    label : str
        What is being done.
    """
    LOG.info(label)
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(file=sys.stderr), disable=not _shows_bars(), transient=True) as bar:
        bar.add_task(label)
        yield


def _shows_bars():
    """Whether there is a terminal or a notebook that shows a bar; a notebook needs ipywidgets for it."""
    if is_quiet():
        return False
    return sys.stderr.isatty() or (Console().is_jupyter and find_spec("ipywidgets") is not None)
