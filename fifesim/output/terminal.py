"""
Terminal output of commands: errors with exit codes, memory and interrupts.

Commands import without collecting garbage and end without looking for it (`importing`): 2.4 s instead of 2.9 s of
processor time for the imports of a run, and 2.9 s instead of 3.5 s with the end of the interpreter.
"""

import atexit
import gc
import json
import logging
import os
import signal
import sys
import threading
import warnings
from contextlib import contextmanager
from enum import IntEnum
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits
from typer.core import TyperGroup

from fifesim.base.files import in_a_line
from fifesim.base.messages import LOG, is_quiet, quiet


@contextmanager
def interrupts_blocked():
    """Context that delays Ctrl-C: KeyboardInterrupt is raised at its end."""
    # An interrupted import fails in other ways, and processes started within the context never receive Ctrl-C.
    handler = signal.getsignal(signal.SIGINT)
    can_block = threading.current_thread() is threading.main_thread() and hasattr(signal, "pthread_sigmask")
    if not can_block or handler is not signal.default_int_handler:
        # In another thread, on Windows, and where Ctrl-C is ignored or has another handler.
        yield
        return
    # The mask protects child processes. In this process, another thread may receive the signal.
    pressed = []
    signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
    if pressed:
        raise KeyboardInterrupt


# Length of a message, and of its lines if they are many. [character]
_LONGEST, _SHORTEST = 500, 40

# Error of click, or of the copy in typer, on arguments.
_UsageError = typer.BadParameter.__base__


class Exit(IntEnum):
    """Exit codes: invalid request, failure, and Ctrl-C."""

    MISTAKE = 2
    FAILURE = 1
    INTERRUPTED = 130


class Commands(TyperGroup):
    """Common exit of all commands. Errors and Ctrl-C print one line, and the exit code tells them apart."""

    def main(self, *arguments, **options):
        """Run the command line, and exit with its code."""
        try:
            with warnings.catch_warnings():
                warnings.showwarning = print_warning
                code = super().main(*arguments, **options | {"standalone_mode": False})
            if code == Exit.INTERRUPTED:
                # typer turns Ctrl-C into this code.
                raise KeyboardInterrupt
            sys.exit(code)
        except (KeyboardInterrupt, typer.Abort):
            exit_with_error("interrupted; nothing was written", Exit.INTERRUPTED)
        except _UsageError as error:
            error.message = in_a_line(error.message)
            error.show()
            sys.exit(error.exit_code)
        except (ValueError, FileNotFoundError, IsADirectoryError) as error:
            exit_with_error(error, Exit.MISTAKE)
        except (OSError, MemoryError, RuntimeError, ImportError) as error:
            exit_with_error(error or "out of memory", Exit.FAILURE)

    def invoke(self, context):
        """Run a command. Click takes the error of a file that ends early for Ctrl-D."""
        try:
            return super().invoke(context)
        except EOFError as error:
            raise OSError(f"a file ends early: {error or 'no details'}") from error


def _be_quiet(context: typer.Context, wanted: bool):
    if wanted:
        context.with_resource(quiet())


def _be_verbose(context: typer.Context, times: int):
    if times:
        context.with_resource(listening(logging.INFO if times == 1 else logging.DEBUG))


Quiet = Annotated[bool, typer.Option("--quiet", "-q", callback=_be_quiet, help="Only print errors.")]
Verbose = Annotated[
    int,
    typer.Option(
        "--verbose", "-v", count=True, callback=_be_verbose, show_default=False,
        help="Print each step; -vv for more detail.",
    ),
]  # fmt: skip
"""Options of long commands; their callbacks take effect before the command begins."""


class _Lines(logging.Formatter):
    """Log records as lines without control characters."""

    def format(self, record):
        return in_a_line(super().format(record), sys.maxsize)


@contextmanager
def listening(level):
    """Context in which the logger ``fifesim`` writes to standard error."""
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
    """Context for slow imports at the start of a command."""
    # Imported objects are permanent: garbage collection among them takes a sixth of the import time, and half of the
    # time at exit. The number of BLAS threads is set afterwards, as numpy comes with the package.
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


def print_lines(*texts, err=False):
    """Print texts without control characters."""
    for text in texts:
        typer.echo("\n".join(in_a_line(line, sys.maxsize) for line in str(text).split("\n")), err=err)


def print_warning(message, *_):
    """Print a warning as a line."""
    print_lines(in_a_line(f"fifesim: warning: {message}"), err=True)


@contextmanager
def kept(output):
    """Context that reports the remaining files when a run is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        left = (
            f"finished blocks are kept, continue with --resume -o {output}"
            if output.exists()
            else "nothing was written"
        )
        exit_with_error(f"interrupted; {left}", Exit.INTERRUPTED)


def report(files, seconds, look, as_json=False, finished=False):
    """Print the files that a command has made, its duration and the file to open, unless quiet."""
    if as_json:
        print_lines(
            json.dumps({"event": "finished", "files": [str(path) for path in files], "seconds": round(seconds, 1)})
        )
    elif not is_quiet():
        done = "this run is already finished" if finished else f"done in {in_time(seconds)}"
        print_lines(*files, f"{done}: open {look}")


def in_time(seconds):
    """Duration as text."""
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def exit_with_error(error, code):
    """Exit with a message and a code."""
    lines = str(error).split("\n")
    length = max(_LONGEST // len(lines), _SHORTEST)
    print_lines(
        "\n".join(in_a_line(line, length) for line in ["fifesim: " + lines[0], *lines[1:]][: _LONGEST // _SHORTEST]),
        err=True,
    )
    try:
        sys.stdout.flush()
    except OSError:
        # Otherwise the interpreter would report the failed flush again at exit, with a traceback.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)
