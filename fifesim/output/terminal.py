"""How commands speak: one line for a mistake, an exit code that says whose it is, nothing that steers a terminal."""

import atexit
import gc
import json
import logging
import os
import sys
import warnings
from contextlib import contextmanager
from enum import IntEnum
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits
from typer.core import TyperGroup

from fifesim.base.foreign import in_a_line
from fifesim.base.logs import LOG, is_quiet, quiet
from fifesim.output.process import interrupts_blocked, keep_freed

# Of a message, and of a line in one of many. [character]
_LONGEST, _SHORTEST = 500, 50

# What click, or the one that typer brings, says of arguments.
_UsageError = typer.BadParameter.__base__


class Exit(IntEnum):
    """Exit codes: what was asked cannot be done, what could be done failed, and somebody pressed Ctrl-C."""

    MISTAKE = 2
    FAILURE = 1
    INTERRUPTED = 130


class Door(TyperGroup):
    """The one way out of all commands: a mistake or Ctrl-C is one line, and the exit code tells the kind."""

    def main(self, *arguments, **options):
        """
        Run the command line, and end with its exit code.

        Raises
        ------
        SystemExit
            Always.
        """
        try:
            with warnings.catch_warnings():
                warnings.showwarning = tell
                code = super().main(*arguments, **options | {"standalone_mode": False})
            if code == Exit.INTERRUPTED:
                # typer turns Ctrl-C into this code.
                raise KeyboardInterrupt
            sys.exit(code)
        except (KeyboardInterrupt, typer.Abort):
            stop("interrupted; nothing is written", Exit.INTERRUPTED)
        except _UsageError as error:
            error.message = in_a_line(error.message)
            error.show()
            sys.exit(error.exit_code)
        except (ValueError, FileNotFoundError, IsADirectoryError) as error:
            stop(error, Exit.MISTAKE)
        except (OSError, MemoryError, RuntimeError, ImportError) as error:
            stop(error or "memory does not suffice", Exit.FAILURE)


def _be_quiet(context: typer.Context, wanted: bool):
    if wanted:
        context.with_resource(quiet())


def _be_verbose(context: typer.Context, times: int):
    if times:
        context.with_resource(listening(logging.INFO if times == 1 else logging.DEBUG))


Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", callback=_be_quiet, help="No progress and no list of files; mistakes stay.")
]
Verbose = Annotated[
    int, typer.Option("--verbose", "-v", count=True, callback=_be_verbose, help="Say each step; -vv its parts too.")
]
"""Options of commands that take long; they are at work before the command begins, which need not look at them."""


class _Lines(logging.Formatter):
    """A record as a line that cannot steer a terminal."""

    def format(self, record):
        return in_a_line(super().format(record), sys.maxsize)


@contextmanager
def listening(level):
    """
    A context within which the logger ``fifesim`` is heard on standard error.

    Parameters
    ----------
    level : int
        Of `logging`, from which it is heard.
    """
    handler, before = logging.StreamHandler(), LOG.level
    handler.setFormatter(_Lines("%(asctime)s %(message)s", "%H:%M:%S"))
    LOG.addHandler(handler)
    LOG.setLevel(level)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(before)


@contextmanager
def importing():
    """
    A context for slow imports, with which a command that works on scenes begins.

    They make objects that stay: to look for garbage among them takes a sixth of their time, and among all that there is
    when the interpreter ends half of its last moments. numpy, which comes with the package before a command can say how
    many threads its BLAS may have, is told afterwards.
    """
    keep_freed()
    atexit.register(gc.freeze)
    gc.disable()
    try:
        with interrupts_blocked():
            yield
    finally:
        gc.freeze()
        gc.enable()
        if os.environ.get("OPENBLAS_NUM_THREADS") == "1":
            threadpool_limits(1, user_api="blas")


def say(*texts, err=False):
    """
    Print texts, in which names and values from elsewhere cannot steer a terminal.

    Parameters
    ----------
    *texts : str or object
    err : bool, optional
        To standard error.
    """
    for text in texts:
        typer.echo("\n".join(in_a_line(line, sys.maxsize) for line in str(text).split("\n")), err=err)


def tell(message, *_):
    """
    Print a warning as a line.

    Parameters
    ----------
    message : str or Warning
    """
    say(in_a_line(f"fifesim: warning: {message}"), err=True)


@contextmanager
def kept(output):
    """
    A context within which who interrupts a run is told what is left of it.

    Parameters
    ----------
    output : pathlib.Path
        Folder of the results.
    """
    try:
        yield
    except KeyboardInterrupt:
        left = f"what is finished is kept, go on with --resume -o {output}" if output.exists() else "nothing is written"
        stop(f"interrupted; {left}", Exit.INTERRUPTED)


def report(files, seconds, look, as_json=False, finished=False):
    """
    Say which files a command has made, how long it took, and where to look first, unless it is to be quiet.

    Parameters
    ----------
    files : sequence of path
    seconds : float
    look : str
        What to open, such as ``"out/report.html in a browser"``.
    as_json : bool, optional
        A line of JSON instead.
    finished : bool, optional
        The files were complete before the command began.
    """
    if as_json:
        say(json.dumps({"event": "finished", "files": [str(path) for path in files], "seconds": round(seconds, 1)}))
    elif not is_quiet():
        done = "this run was finished before, nothing is left to do" if finished else f"done in {in_time(seconds)}"
        say(*files, f"{done}: open {look}")


def in_time(seconds):
    """
    A time as a person says it.

    Parameters
    ----------
    seconds : float

    Returns
    -------
    text : str

    Examples
    --------
    >>> in_time(8.26), in_time(119.7), in_time(7384)
    ('8.3 s', '2 min 0 s', '2 h 3 min')
    """
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def stop(error, code):
    """
    End with a message and an exit code.

    Parameters
    ----------
    error : str or Exception
    code : Exit
    """
    lines = str(error).split("\n")
    length = max(_LONGEST // len(lines), 40)
    say("\n".join(in_a_line(line, length) for line in ["fifesim: " + lines[0], *lines[1:]][: _LONGEST // 40]), err=True)
    try:
        sys.stdout.flush()
    except OSError:
        # What standard output does not take would be said again, at length, when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)
