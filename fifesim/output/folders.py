"""Folders of results: locks, checks for folders in use, atomic writing, and provenance."""

import importlib.metadata
import os
import platform
import shutil
import socket
import stat
from contextlib import contextmanager, suppress
from datetime import UTC, datetime

from filelock import FileLock, Timeout

from fifesim.base.caches import cached
from fifesim.base.files import flush

_PACKAGES = (
    "fifesim", "numpy", "scipy", "xarray", "dask", "numba", "rasterio", "odc-geo", "pvlib", "pyrsr", "matplotlib",
)  # fmt: skip

# Cached, because each call parses a file, and a run asks for all versions five times.
_version = cached(128, "versions of libraries")(importlib.metadata.version)


def versions():
    """Versions of Python and of the packages that affect numbers and pictures."""
    return {"python": platform.python_version()} | {name: _version(name) for name in _PACKAGES}


# Hidden folder of an unfinished run, in the folder of its results.
UNFINISHED = ".unfinished"

# In the hidden folder: a lock that ends with its process, the name of its holder, the file that marks a run as begun,
# and earlier results that the run has replaced.
_LOCK, _HOLDER, BEGUN, _REPLACED = "lock", "holder", "run.toml", "replaced"


def check_folder(folder, overwrite, resume=False, names=None):
    """Raise ValueError for an output folder in use; return whether the run to be resumed is finished."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise ValueError(f"the output folder {str(folder)!r} is a file: name another with -o")
    if not folder.is_dir():
        return False
    begun = (folder / UNFINISHED / BEGUN).is_file()
    whole = bool(names) and not begun and all((folder / name).exists() for name in names)
    finished = resume and not overwrite and whole
    if (folder / UNFINISHED).is_dir():
        with _locked_hidden_folder(folder) as hidden:
            if finished:
                # Remains of a run that was killed after moving its last file.
                _empty(hidden)
    if not finished:
        _check_contents(folder, overwrite, resume)
    return finished


def _check_contents(folder, overwrite, resume):
    if overwrite:
        return
    begun = (folder / UNFINISHED / BEGUN).is_file()
    if begun and not resume:
        raise ValueError(
            f"the output folder {str(folder)!r} has an unfinished run: continue it with --resume, "
            "start again with --overwrite, or use another folder with -o (in Python, resume=True and overwrite=True)"
        )
    if not begun and {path.name for path in folder.iterdir()} - {UNFINISHED}:
        held = "has nothing to resume and is not empty" if resume else "is not empty"
        raise ValueError(
            f"the output folder {str(folder)!r} {held}: name another with -o, or add --overwrite (in Python, "
            "overwrite=True)"
        )


@contextmanager
def results(folder, names, *, overwrite=False, resume=False, worth_keeping=None, stale=()):
    """Context manager of a hidden folder for results, which are moved into place when complete, and a lock."""
    existed = folder.is_dir()
    (folder / UNFINISHED).mkdir(parents=True, exist_ok=True)
    try:
        with _locked_hidden_folder(folder) as hidden:
            _check_contents(folder, overwrite, resume)
            if resume:
                # The run makes the files again that were replaced by links or devices.
                for parent, folders, files in os.walk(hidden):
                    for name in (*folders, *files):
                        _remove_unless_plain(os.path.join(parent, name))
            else:
                _empty(hidden)
            try:
                yield hidden
                _move_into_place(hidden, folder, names, stale)
            except BaseException as error:
                if not (worth_keeping and worth_keeping(hidden, error)):
                    _empty(hidden)
                raise
            _empty(hidden)
    finally:
        if not existed:
            # Fails if other files were written into it in the meantime.
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def errors_with_their_file(folder):
    """Context manager that adds the file and the remedy to operating system errors."""
    try:
        yield
    except OSError as error:
        name = f" ({error.filename})" if error.filename and str(error.filename) not in str(error.strerror) else ""
        message = f"{error.strerror}{name}" if error.strerror else str(error)
        hint = f"; finished blocks are kept, continue with --resume -o {folder}"
        raise OSError(f"{message}{hint if (folder / UNFINISHED).exists() else ''}") from error


@contextmanager
def _locked_hidden_folder(folder):
    """Hidden folder of a run, locked until this process ends, and removed if it remains empty."""
    hidden = folder / UNFINISHED
    holder = hidden / _HOLDER
    if hidden.is_symlink():
        raise ValueError(f"{str(hidden)!r} is a link: remove it, or name another folder with -o")
    _remove_unless_plain(hidden / _LOCK)
    try:
        taken = FileLock(hidden / _LOCK).acquire(timeout=0)
    except (Timeout, FileNotFoundError):
        by = holder.read_text(encoding="utf-8") if holder.is_file() else "another run"
        raise ValueError(
            f"the output folder {str(folder)!r} is in use by {by}: wait until it ends, or use another folder with -o"
        ) from None
    with taken:
        began = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
        try:
            _remove_unless_plain(holder)
            holder.write_text(f"process {os.getpid()} on {socket.gethostname()}, begun {began}", encoding="utf-8")
            yield hidden
        finally:
            holder.unlink(missing_ok=True)
            if [path.name for path in hidden.iterdir()] == [_LOCK]:
                shutil.rmtree(hidden, ignore_errors=True)
    with suppress(OSError):
        hidden.rmdir()


def _remove_unless_plain(path):
    """Remove a link, pipe, socket or device, which a run would follow or wait for."""
    if os.path.lexists(path) and stat.S_IFMT(os.lstat(path).st_mode) not in (stat.S_IFREG, stat.S_IFDIR):
        os.unlink(path)


def _empty(hidden):
    """Remove everything in a hidden folder except the lock and the name of its holder."""
    # Without the mark of a started run, the remains are not resumed.
    (hidden / BEGUN).unlink(missing_ok=True)
    for path in hidden.iterdir():
        if path.name not in (_LOCK, _HOLDER):
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _move_into_place(hidden, folder, names, stale):
    """Replace earlier results with new ones, the mark of completeness last; an error undoes all moves."""
    # After a power cut, the mark must not stand for files that are not on the disk.
    flush(*(path for name in names for path in (hidden / name, *(hidden / name).rglob("*"))))
    # The last name marks results as complete. The earlier mark is moved away first, so that a process that is killed
    # leaves files of one run only, without the mark.
    replaced = hidden / _REPLACED
    shutil.rmtree(replaced, ignore_errors=True)
    replaced.mkdir()
    # GDAL and GIS keep statistics of a raster in a separate file, which is not valid for the new raster.
    earlier = [each for name in reversed([*stale, *names]) for each in (name, f"{name}.aux.xml")]
    moves = [(folder / name, replaced / name) for name in earlier if os.path.lexists(folder / name)]
    moves += [(hidden / name, folder / name) for name in names]
    try:
        for source, target in moves[:-1]:
            os.replace(source, target)
        flush(folder)
        os.replace(*moves[-1])
        flush(folder)
    except BaseException:
        for source, target in reversed(moves):
            if os.path.lexists(target) and not os.path.lexists(source):
                os.replace(target, source)
        raise
