"""Folders of results: refused where in use, and filled with whole files only."""

import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path

# Folder of a run that is not finished, in the folder of its results.
UNFINISHED = ".unfinished"


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
        If it is a file, or holds something and neither ``overwrite`` nor ``resume`` is on.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"the output folder {str(folder)!r} is a file: name another with -o")
    if not folder.is_dir() or overwrite:
        return
    held = {path.name for path in folder.iterdir()}
    if UNFINISHED in held and not resume:
        raise ValueError(
            f"the output folder {str(folder)!r} holds a run that is not finished: go on with it by --resume, "
            "begin again with --overwrite, or name another with -o"
        )
    if held - {UNFINISHED} and not resume:
        raise ValueError(f"the output folder {str(folder)!r} is not empty: name another with -o, or add --overwrite")


@contextmanager
def results(folder, names, *, resume=False, worth_keeping=None):
    """
    A hidden folder to write results into, which come into place when all of them are whole; a context manager.

    Parameters
    ----------
    folder : pathlib.Path
        Made where it does not exist, and removed again where nothing comes of it.
    names : iterable of str
        Files and folders that come into place, and replace what has their names.
    resume : bool, optional
        Go on with what was kept.
    worth_keeping : callable, optional
        ``worth_keeping(hidden, error)`` says whether the hidden folder outlives an error, for another run to go on
        with. It is always removed without.

    Yields
    ------
    hidden : pathlib.Path
        `UNFINISHED` where it may be kept, else a folder of this run alone.
    """
    existed = folder.is_dir()
    folder.mkdir(parents=True, exist_ok=True)
    hidden = _kept(folder, resume) if worth_keeping else Path(tempfile.mkdtemp(prefix=".partial-", dir=folder))
    try:
        yield hidden
        for name in names:
            _replace(hidden / name, folder / name)
    except BaseException as error:
        if not (worth_keeping and worth_keeping(hidden, error)):
            shutil.rmtree(hidden, ignore_errors=True)
            if not existed:
                shutil.rmtree(folder, ignore_errors=True)
        raise
    shutil.rmtree(hidden)


def _kept(folder, resume):
    hidden = folder / UNFINISHED
    if not resume:
        shutil.rmtree(hidden, ignore_errors=True)
    hidden.mkdir(exist_ok=True)
    return hidden


def _replace(source, target):
    if target.is_dir() and not target.is_symlink():
        shutil.rmtree(target)
    os.replace(source, target)
