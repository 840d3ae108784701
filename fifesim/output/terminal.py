"""What commands say on a terminal: lines, warnings, mistakes, and exit codes that say whose they are."""

import os
import sys
from enum import IntEnum

import typer

from fifesim.base.foreign import in_a_line

# Of a message. [character]
_LONGEST = 500


class Exit(IntEnum):
    """Exit codes: what was asked cannot be done, what could be done failed, and somebody pressed Ctrl-C."""

    MISTAKE = 2
    FAILURE = 1
    INTERRUPTED = 130


def say(*texts, err=False):
    """
    Print texts, in which names and values from elsewhere cannot steer a terminal.

    Parameters
    ----------
    *texts : str or object
    err : bool, optional
        On standard error.
    """
    for text in texts:
        typer.echo("\n".join(in_a_line(line, sys.maxsize) for line in str(text).split("\n")), err=err)


def tell(message, *_):
    """
    Print a warning, which is a line too.

    Parameters
    ----------
    message : Warning
    """
    say(in_a_line(f"fifesim: warning: {message}"), err=True)


def stop(error, code):
    """
    Print an error and end the program.

    Parameters
    ----------
    error : Exception or str
        One line, or several short ones.
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
