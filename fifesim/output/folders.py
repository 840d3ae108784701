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
def whole_files(folder):
    """
    A hidden folder whose files move into place when all of them are written; a context manager.

    Parameters
    ----------
    folder : pathlib.Path
        Made where it does not exist, and removed again where nothing comes of it.

    Yields
    ------
    partial : pathlib.Path
        To write into.
    """
    existed = folder.is_dir()
    folder.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix=".partial-", dir=folder))
    try:
        yield partial
        for path in sorted(partial.iterdir()):
            os.replace(path, folder / path.name)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        if not existed:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    partial.rmdir()
