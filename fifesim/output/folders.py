"""Folders of results: refused where in use, held by one run, and filled with whole files only."""

import os
import shutil
import socket
from contextlib import contextmanager, suppress
from datetime import UTC, datetime

from filelock import FileLock, Timeout

# Folder of a run that is not finished, in the folder of its results.
UNFINISHED = ".unfinished"

# In it: the lock that ends with its process, who has it, and the file by which a run has begun.
_LOCK, _HOLDER, BEGUN = "lock", "holder", "run.toml"


def check_folder(folder, overwrite, resume=False):
    """
    Refuse an output folder that is in use.

    Parameters
    ----------
    folder : pathlib.Path
    overwrite, resume : bool

    Raises
    ------
    ValueError
        If it is a file, another run is writing into it, or it holds something and ``overwrite`` is off, unless
        ``resume`` is on and there is a run to go on with.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise ValueError(f"the output folder {str(folder)!r} is a file: name another with -o")
    if not folder.is_dir():
        return
    if (folder / UNFINISHED).is_dir():
        with _held(folder):
            pass
    _check_contents(folder, overwrite, resume)


def _check_contents(folder, overwrite, resume):
    if overwrite:
        return
    begun = (folder / UNFINISHED / BEGUN).is_file()
    if begun and not resume:
        raise ValueError(
            f"the output folder {str(folder)!r} holds a run that is not finished: go on with it by --resume, "
            "begin again with --overwrite, or name another with -o"
        )
    if not begun and {path.name for path in folder.iterdir()} - {UNFINISHED}:
        held = "has nothing to resume and is not empty" if resume else "is not empty"
        raise ValueError(f"the output folder {str(folder)!r} {held}: name another with -o, or add --overwrite")


@contextmanager
def results(folder, names, *, overwrite=False, resume=False, worth_keeping=None):
    """
    A hidden folder to write results into, which come into place when all of them are whole; a context manager.

    The folder is held meanwhile: no other run can begin in it, on this machine or on another that sees it.

    Parameters
    ----------
    folder : pathlib.Path
        Made where it does not exist, and removed again where nothing comes of it.
    names : iterable of str
        Files and folders that come into place, and replace what has their names.
    overwrite : bool, optional
        Also where the folder holds something.
    resume : bool, optional
        Go on with what was kept.
    worth_keeping : callable, optional
        ``worth_keeping(hidden, error)`` says whether the hidden folder outlives an error, for another run to go on
        with. It is always removed without.

    Yields
    ------
    hidden : pathlib.Path
        Empty but for what was kept, and for who holds it.

    Raises
    ------
    ValueError
        As in `check_folder`.
    """
    existed = folder.is_dir()
    (folder / UNFINISHED).mkdir(parents=True, exist_ok=True)
    try:
        with _held(folder) as hidden:
            _check_contents(folder, overwrite, resume)
            if not resume:
                _empty(hidden)
            try:
                yield hidden
                for name in names:
                    _replace(hidden / name, folder / name)
            except BaseException as error:
                if not (worth_keeping and worth_keeping(hidden, error)):
                    _empty(hidden)
                raise
            _empty(hidden)
    finally:
        if not existed:
            # Not where somebody else's files have come in the meantime.
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def errors_with_their_file(folder):
    """
    Have errors of the system say which file they met, and what can be done; a context manager.

    Parameters
    ----------
    folder : pathlib.Path
        Of results.

    Raises
    ------
    OSError
        In place of another.
    """
    try:
        yield
    except OSError as error:
        name = f" ({error.filename})" if error.filename and str(error.filename) not in str(error.strerror) else ""
        said = f"{error.strerror}{name}" if error.strerror else str(error)
        hint = f"; what is finished is kept, go on with --resume -o {folder}"
        raise OSError(f"{said}{hint if (folder / UNFINISHED).exists() else ''}") from error


@contextmanager
def _held(folder):
    """The hidden folder of a run, held by a lock that ends with this process, however that ends; gone where empty."""
    hidden = folder / UNFINISHED
    holder = hidden / _HOLDER
    try:
        taken = FileLock(hidden / _LOCK).acquire(timeout=0)
    except (Timeout, FileNotFoundError):
        by = holder.read_text(encoding="utf-8") if holder.is_file() else "another run"
        raise ValueError(
            f"the output folder {str(folder)!r} is in use by {by}: wait until that ends, or name another with -o"
        ) from None
    with taken:
        began = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        try:
            holder.write_text(f"process {os.getpid()} on {socket.gethostname()}, begun {began}", encoding="utf-8")
            yield hidden
        finally:
            holder.unlink(missing_ok=True)
            if [path.name for path in hidden.iterdir()] == [_LOCK]:
                shutil.rmtree(hidden, ignore_errors=True)
    with suppress(OSError):
        hidden.rmdir()


def _empty(hidden):
    """Remove all of a hidden folder but its lock and the name of who holds it."""
    for path in hidden.iterdir():
        if path.name not in (_LOCK, _HOLDER):
            _remove(path)


def _remove(path):
    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _replace(source, target):
    if target.is_dir() and not target.is_symlink():
        shutil.rmtree(target)
    os.replace(source, target)
    # What GDAL, or a GIS, kept of a raster that was there before: it would be taken for that of this one.
    target.with_name(f"{target.name}.aux.xml").unlink(missing_ok=True)
