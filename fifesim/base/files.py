"""Files: safe opening of the user's files, and the tables of the data folder."""

import os
import re
import reprlib
import stat
import tempfile
import tomllib
import warnings
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from fifesim.base.caches import cached

# Larger than any scenario or instrument file, and read in a second. [byte]
_LARGEST = 1_000_000
# Most nested tables in one dotted key; tomllib takes time quadratic in their number. Dots next to slashes belong to
# paths and do not count.
_DEEPEST = 100
_DOT_OF_KEY = re.compile(r"[\w\"'-][ \t]*\.(?=[ \t]*[\w\"'-])")

_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}

# Maximum length of a value in a message, and of a line.
_SHOWN = 60
_LINE = 400


def check_regular(path):
    """Raise ValueError if a path is not a regular file, because opening a pipe or a device may block."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        raise ValueError(f"{in_a_line(str(path), 200)} is {_KINDS.get(stat.S_IFMT(mode), 'a device')}: name a file")


def check_suffix(path, kind, *suffixes):
    """Raise ValueError for the name of a new file that ends as another kind of file."""
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{in_a_line(path, 150)} is to be a {kind}: end its name in {suffixes[0]}")


def read_csv(path, what, dtype=None):
    """Read a CSV table, in which ``#`` starts a comment, with the file name in every message."""
    with reading(what, path, "; it must be CSV in UTF-8"), warnings.catch_warnings():
        # Without index_col, pandas takes surplus values for an index.
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            return pd.read_csv(path, comment="#", skipinitialspace=True, index_col=False, dtype=dtype)
        except pd.errors.ParserWarning:
            raise ValueError(
                "rows have more values than the first line has names; name all columns, and write decimals with a point"
            ) from None


@contextmanager
def reading(what, path, cure=""):
    """Context of the reading of a file on this disk, with the file name in every message."""
    beginning = f"cannot read {what} {in_a_line(str(path), 200)}"
    if "://" in str(path):
        raise ValueError(f"{beginning}: it is an address; download the file and give its path")
    try:
        check_regular(path)
        yield
    except FileNotFoundError:
        raise ValueError(f"{beginning}: there is no such file") from None
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"{beginning}: {in_a_line(reason, 150)}{cure}") from None


def read_bounded(path, largest, what):
    """Read a regular file of bounded size."""
    path = Path(path)
    check_regular(path)
    size = path.stat().st_size
    if size > largest:
        name = in_a_line(path.name)
        raise ValueError(f"{name} has {size} bytes: {what} has at most {largest}; is it another file?")
    return path.read_bytes()


def read_toml(path):
    """Read a TOML file."""
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


def check_target(path):
    """Raise OSError if no file can be written at a path."""
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{in_a_line(path, 150)} is a folder: give the name of a file in it")
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"there is no folder {in_a_line(path.parent, 150)!r} to write {in_a_line(path.name)} into"
        )
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"files cannot be written into {in_a_line(path.parent, 150)!r}: give another folder")


@contextmanager
def whole_file(path):
    """Context with the path of a new file in a private folder, which becomes the file if there is no error."""
    path = Path(path)
    check_target(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        new = Path(folder) / f"whole{path.suffix}"
        yield new
        flush(new)
        os.replace(new, path)
        flush(path.parent)


def flush(*paths):
    """Write files, and the entries of folders, to the disk, so that they survive a power cut."""
    for path in paths if os.name == "posix" else ():
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        except OSError:
            # Some network disks do not flush folders.
            if not os.path.isdir(path):
                raise
        finally:
            os.close(number)


def shown(value):
    """Short printable text of a value, for messages."""
    brief = reprlib.Repr()
    brief.maxstring = brief.maxother = brief.maxlong = _SHOWN
    brief.maxlevel = 3
    try:
        return in_a_line(brief.repr(value), _SHOWN)
    except ValueError:
        # Python writes no whole number of more than 4300 digits.
        return "a number of thousands of digits"


def in_a_line(text, length=_LINE):
    """Text in one line: unprintable characters are escaped, and the middle of a long text is left out."""
    line = "".join(character if character.isprintable() else repr(character)[1:-1] for character in str(text))
    if len(line) <= length:
        return line
    half = (length - 3) // 2
    return f"{line[:half]}...{line[-half:]}"


_PACKAGE = Path(__file__).parents[1]


def path(name):
    """Path of a file of the data folder, in the wheel or in a checkout."""
    for folder in (_PACKAGE / "data", _PACKAGE.parent / "data"):
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"the data file {name!r} is missing from this installation: reinstall fifesim")


@cached(128, "data files")
def _read(name):
    return pd.read_csv(path(name), comment="#")


def table(name):
    """Copy of a CSV table of the data folder, whose header comments give source, units and columns."""
    return _read(name).copy()
