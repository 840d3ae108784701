"""A progress bar for what dask computes, shown on a terminal only."""

import sys

from dask.callbacks import Callback
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
    track,
)


class ProgressBar(Callback):
    """
    Show how many tasks of a computation are done; a context manager around the call that computes.

    Parameters
    ----------
    label : str
        What is being done.
    """

    def __init__(self, label):
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=Console(file=sys.stderr),
            disable=not sys.stderr.isatty(),
            transient=True,
        )
        self._task = self._progress.add_task(label, total=None)
        super().__init__(start_state=self._begin, posttask=self._advance)

    def __enter__(self):
        self._progress.start()
        return super().__enter__()

    def __exit__(self, *error):
        self._progress.stop()
        return super().__exit__(*error)

    def _begin(self, graph, state):
        self._progress.update(self._task, total=len(state["ready"]) + len(state["waiting"]))

    def _advance(self, key, result, graph, state, worker):
        self._progress.advance(self._task)


def steps(sequence, label):
    """
    Go through a sequence and show how far it is, on a terminal only.

    Parameters
    ----------
    sequence : sequence
    label : str
        What is being done.

    Returns
    -------
    sequence : iterator
    """
    console = Console(file=sys.stderr)
    return track(sequence, label, console=console, disable=not sys.stderr.isatty(), transient=True)
