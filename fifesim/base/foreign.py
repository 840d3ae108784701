"""What comes from outside: files that are opened only where that cannot hang, and values that messages repeat."""

import os
import re
import reprlib
import stat
import tomllib
import warnings
from pathlib import Path

import pandas as pd

# Larger than any scenario or instrument file, and read in a second. [byte]
_LARGEST = 1_000_000
# Tables within tables in one dotted key, for which tomllib takes the square of their number in time. The dots of a path
# lie beside slashes.
_DEEPEST = 100
_DOT_OF_KEY = re.compile(r"[\w\"'-][ \t]*\.(?=[ \t]*[\w\"'-])")

_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}

# The longest that a message repeats of one value, and what a line of it may have.
_SHOWN = 60
_LINE = 400


def check_regular(path):
    """
    Refuse what is no regular file: to open a pipe or a device may wait for ever.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    ValueError
        If it is a folder, a pipe, a socket or a device, or no file can have the name.
    OSError
        If it is missing, or cannot be looked at.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        raise ValueError(f"{in_a_line(str(path), 200)} is {_KINDS.get(stat.S_IFMT(mode), 'a device')}: name a file")


def read_csv(path, what):
    """
    Table of a CSV file, whose name is in every message.

    Parameters
    ----------
    path : str or path
        Of a regular file; ``#`` starts a comment.
    what : str
        What the file holds, for messages, such as "the spectrum".

    Returns
    -------
    table : pandas.DataFrame

    Raises
    ------
    ValueError
        If the path is an address, a folder, a pipe or a device, or if the file is missing, cannot be read as CSV or has
        rows with more values than its first line has names.
    """
    name = in_a_line(str(path), 200)
    if "://" in str(path):
        raise ValueError(f"cannot read {what} {name}: it is an address; download the file and give its path")
    try:
        check_regular(path)
        with warnings.catch_warnings():
            # Without index_col, pandas takes surplus values for an index.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False)
    except FileNotFoundError:
        raise ValueError(f"cannot read {what} {name}: there is no such file") from None
    except pd.errors.ParserWarning:
        raise ValueError(
            f"cannot read {what} {name}: rows have more values than the first line has names; name all columns, and "
            "write decimals with a point"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"cannot read {what} {name}: {in_a_line(reason, 150)}; it must be CSV in UTF-8") from None


def read_bounded(path, largest, what):
    """
    Bytes of a regular file of bounded size.

    Parameters
    ----------
    path : str or path
    largest : int
        [byte]
    what : str
        What a file of that size at most is, for messages.

    Returns
    -------
    content : bytes

    Raises
    ------
    ValueError
        If it is no regular file, or larger.
    OSError
        If it is missing, or cannot be read.
    """
    path = Path(path)
    check_regular(path)
    size = path.stat().st_size
    if size > largest:
        name = in_a_line(path.name)
        raise ValueError(f"{name} has {size} bytes: {what} has at most {largest}; is it another file?")
    return path.read_bytes()


def read_toml(path):
    """
    Values of a TOML file.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    values : dict

    Raises
    ------
    ValueError
        If it is no regular file, too large, or not TOML.
    OSError
        If it is missing, or cannot be read.
    """
    content, name = read_bounded(path, _LARGEST, "a file of keys"), in_a_line(Path(path).name)
    try:
        text = content.decode("utf-8")
        if any(len(_DOT_OF_KEY.findall(part)) > _DEEPEST for part in re.split(r"[=,\n]", text)):
            raise RecursionError
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"{name} nests its tables too deeply: a key lies in a section, section.key") from None
    except ValueError as error:
        raise ValueError(in_a_line(f"{name} is not valid TOML: {error}")) from None


def shown(value):
    r"""
    A value as a message repeats it: short, and in characters that a terminal prints.

    Parameters
    ----------
    value : object

    Returns
    -------
    text : str

    Examples
    --------
    >>> print(shown("TM\x1b[31m"), shown(0.25), len(shown("a" * 1000)))
    'TM\x1b[31m' 0.25 60
    """
    brief = reprlib.Repr()
    brief.maxstring = brief.maxother = brief.maxlong = _SHOWN
    brief.maxlevel = 3
    try:
        return in_a_line(brief.repr(value), _SHOWN)
    except ValueError:
        # Python writes no whole number of more than 4300 digits.
        return "a number of thousands of digits"


def in_a_line(text, length=_LINE):
    r"""
    A text in one line: what does not print is escaped, and the middle of a long one left out.

    Parameters
    ----------
    text : str or object
        What `str` makes of it.
    length : int, optional
        At most.

    Returns
    -------
    line : str

    Examples
    --------
    >>> print(in_a_line("no such file: a\nb"), in_a_line("a" * 50 + "z" * 50, 13))
    no such file: a\nb aaaaa...zzzzz
    """
    line = "".join(character if character.isprintable() else repr(character)[1:-1] for character in str(text))
    if len(line) <= length:
        return line
    half = (length - 3) // 2
    return f"{line[:half]}...{line[-half:]}"
