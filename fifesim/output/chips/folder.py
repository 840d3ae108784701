"""A dataset: the chips of a study written into a folder shard by shard, which can be stopped and gone on with."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fifesim.base.annotations import FilePath, WholeNumber
from fifesim.base.kinds import described
from fifesim.base.warned import warn
from fifesim.ground.landscape.field import TILE
from fifesim.output.chips import datasheet
from fifesim.output.chips.arrays import layout_of
from fifesim.output.chips.makers import makers_of
from fifesim.output.chips.making import made_shards
from fifesim.output.chips.store import ROOT, Shards, checksums, chips_in, make_store, stored_names, write_shard
from fifesim.output.folders import BEGUN, UNFINISHED, check_folder, errors_with_their_file, results
from fifesim.output.progress import ChipProgress
from fifesim.output.provenance import versions
from fifesim.output.run.identity import (
    STATE,
    begin,
    check_finished,
    check_inputs,
    inputs_of,
    kept_state,
    with_checksums,
)
from fifesim.output.run.saved import has_blocks, save_block, saved_block
from fifesim.rasters.clients import found_client
from fifesim.scenario.chips import chips_of
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.studies import Study, StudyLike, read_study

_FILES = DATASHEET, CONTACT_SHEET, STUDY = "datasheet.html", "contact_sheet.png", "study.toml"

WHOLE = (*_FILES, ROOT)
"""Files by which a dataset is known to be whole."""

# Of shards that are written, what their files' checksums are saved by.
_SAVED = "chips"

# So many chips are looked at before the first is made, and so many closely: what cannot be is told early. [1]
_LOOKED_AT, _CLOSELY = 1000, 50


def dataset(
    study: StudyLike,
    folder: FilePath,
    n: int = 1000,
    *,
    overwrite: bool = False,
    resume: bool = False,
    workers: WholeNumber = 1,
    client: Any = None,
) -> xr.Dataset:
    """
    Make a training set: chips of a study in a folder, as sharded Zarr.

    Parameters
    ----------
    study : str, path or fifesim.Study
    folder : str or path
        Made where it does not exist; a Zarr store, with datasheet.html, contact_sheet.png and study.toml in it.
    n : int, optional
        Chips.
    overwrite : bool, optional
        Replace an earlier dataset where the folder holds one.
    resume : bool, optional
        Go on with an interrupted run of the same study in this folder, or begin if there is none. Nothing is made if
        the dataset is finished.
    workers : int, optional
        Make chips in so many processes of this machine. In a script, call it below ``if __name__ == "__main__":``, as
        the processes import it.
    client : distributed.Client, optional
        Make shards on the workers of a cluster, by default on those of the current client where there is one.

    Returns
    -------
    dataset : xarray.Dataset
        Lazy. Along ``chip``: digital numbers ``dn``, ``toa_reflectance`` and ``ndvi`` of the image, ``lai``, ``fpar``
        and all else that is true of the ground of its pixels, and as coordinates what was drawn, ``landscape`` and
        ``split``.

    Raises
    ------
    ValueError
        If the study is not possible, the folder holds something else, or both workers and a client are given. Nothing
        is written then.
    OSError
        If a file cannot be read or written. Shards that are finished are kept.

    Notes
    -----
    Chip k is `fifesim.simulate` of ``fifesim.chips_of(study, n).scenario(k)``, to the bit, whatever makes it; truth and
    reflectance are kept in single precision.

    Examples
    --------
    >>> from fifesim import dataset
    >>> chips = dataset("study.toml", "chips.zarr", 10_000)  # doctest: +SKIP
    >>> train = chips.sel(chip=chips.split == "train")  # doctest: +SKIP
    """
    study = study if isinstance(study, Study) else read_study(study)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ValueError(f"workers must be a whole number of processes from 1 up, got {described(workers)}")
    if workers > 1 and client is not None:
        raise ValueError("workers starts processes and client is of a cluster that runs: give one of them")
    # One by itself is this process.
    workers = workers if workers > 1 else None
    dataset_to_folder(study, folder, n, overwrite=overwrite, resume=resume, workers=workers, client=client)
    return xr.open_zarr(folder)


def dataset_to_folder(study, folder, count, *, overwrite=False, resume=False, workers=None, client=None, as_json=False):
    """
    Make the chips of a study in a folder.

    Parameters
    ----------
    study : fifesim.scenario.studies.Study
    folder : str or path
    count : int
        Chips.
    overwrite, resume, client
        As in `dataset`.
    workers : int, optional
        Make them in so many processes of this machine.
    as_json : bool, optional
        Print progress as lines of JSON.

    Returns
    -------
    files : list of pathlib.Path
        The folder, and what in it is for people.

    Raises
    ------
    ValueError
        As in `dataset`.
    OSError
        As in `dataset`.
    """
    folder = Path(folder)
    if check_folder(folder, overwrite, resume, WHOLE):
        _check_finished(folder, chips_of(study, count))
        return [folder, *(folder / name for name in _FILES)]
    with makers_of(study, count, workers) if workers else nullcontext() as makers:
        way = {"makers": makers, "client": client or found_client()}
        chips = chips_of(study, count)
        _look_at(chips)
        _warn_of_empty_parts(chips)
        layout = layout_of(chips)
        # The root makes the folder a store: it comes last.
        names = [*stored_names(chips, layout), *_FILES, ROOT]
        stale = _other_arrays(folder, names) if overwrite or resume else ()
        kept = results(folder, names, overwrite=overwrite, resume=resume, worth_keeping=has_blocks, stale=stale)
        with errors_with_their_file(folder), kept as unfinished:
            _make(chips, layout, unfinished, as_json, way)
    return [folder, *(folder / name for name in _FILES)]


def _check_finished(folder, chips):
    """Refuse a finished dataset that is not the one asked for."""
    check_finished(folder / STUDY, read_study(folder / STUDY).to_toml(), chips.study.to_toml(), _inputs(chips))
    if (found := chips_in(folder)) != len(chips):
        raise ValueError(
            f"{folder} holds a finished dataset of {found} chips, not {len(chips)}: give that number, name another "
            "folder with -o, or make it again with --overwrite"
        )


def _make(chips, layout, folder, as_json, way):
    """The whole dataset, in a folder that may hold a part of it."""
    identity, shards = _identity_of(chips), Shards(len(chips), layout.size, _together(chips.study))
    begin(folder, identity)
    _remove_partial(folder)
    make_store(folder, chips, layout, shards)
    _compute(chips, layout, shards, folder, as_json, way)
    datasheet.write(folder, chips, shards, DATASHEET, CONTACT_SHEET)
    (folder / STUDY).write_text(chips.study.to_toml(), encoding="utf-8")
    check_inputs(json.loads(identity[STATE])["inputs"], _inputs(chips))


def study_to_resume(folder):
    """
    Study of an unfinished or finished run, and how many chips it makes.

    Parameters
    ----------
    folder : path
        Folder of the results.

    Returns
    -------
    study : fifesim.scenario.studies.Study or None
        None if there is no run in the folder.
    count : int or None
    """
    folder = Path(folder)
    if (folder / UNFINISHED / BEGUN).is_file():
        count = kept_state(folder / UNFINISHED).get("chips")
        return read_study(folder / UNFINISHED / BEGUN), count if isinstance(count, int) else None
    if all((folder / name).is_file() for name in (STUDY, ROOT)):
        return read_study(folder / STUDY), chips_in(folder)
    return None, None


def _look_at(chips):
    """Scenarios of some chips, so that one that cannot be is found before a day of work."""
    last = len(chips) - 1
    warn_of_canopy(chips.scenario(0))
    for chip in (*range(min(last, _LOOKED_AT)), last):
        scenario = chips.scenario(chip)
        if chip < _CLOSELY:
            try:
                scenario.complete()
            except ValueError as error:
                raise ValueError(f"chip {chip}: {error}") from None
    try:
        scenario.geobox()
    except ValueError as error:
        raise ValueError(f"chip {last}: {error}; with more landscapes chips lie nearer to each other") from None


def _warn_of_empty_parts(chips):
    """The first chips lie in as many landscapes, each of which belongs to one part of the split."""
    empty, count = sorted(set(chips.study.split) - set(chips.split)), chips.study.landscapes
    if empty:
        warn(
            f"no chip for {' and '.join(empty)}: {len(chips)} chips lie in as many of {count} landscapes, and each "
            f"of these belongs to one part of the split. Make {count} chips or more (-n), or give fewer landscapes"
        )


def _remove_partial(folder):
    """What a run that was killed was writing."""
    for path in folder.rglob("*.partial"):
        if path.is_file():
            path.unlink()


def _together(study):
    """Chips of all landscapes that fill a tile of their fields each."""
    rows, columns = study.scenario.geobox().shape
    return max(TILE // rows, 1) * max(TILE // columns, 1) * study.landscapes


def _identity_of(chips):
    """What must be the same for shards of two runs to fit together."""
    state = {"versions": versions(), "inputs": with_checksums(_inputs(chips)), "chips": len(chips)}
    return {STATE: json.dumps(state), BEGUN: chips.study.to_toml()}


def _inputs(chips):
    """Files that chips read, those among which it is drawn included."""
    study, found = chips.study, inputs_of(chips.study.scenario)
    for key, distribution in study.drawn.items():
        if key.entry is None and any(key.section.names_a_file(key.key, value) for value in distribution.extremes):
            for value in distribution.extremes:
                found |= inputs_of(study.scenario_with({key.path: value}))
    return found


def _compute(chips, layout, shards, folder, as_json, way):
    """Make and write the shards that are not written yet."""
    blocks, names = folder / "blocks", list(layout.variables)
    wanted = [shard for shard in range(len(shards)) if not _is_written(folder, blocks, names, shard)]
    done = len(chips) - sum(np.diff(shards.range_of(shard)).item() for shard in wanted)
    with ChipProgress(len(chips), done, as_json) as progress:
        for shard, arrays in made_shards(chips, layout, shards, wanted, progress.advance, **way):
            write_shard(folder, shards.range_of(shard)[0], arrays)
            save_block(blocks, _SAVED, (shard,), checksums(folder, names, shard))


def _is_written(folder, blocks, names, shard):
    """Whether the files of a shard are what was written."""
    try:
        return np.array_equal(saved_block(blocks, _SAVED, (shard,)), checksums(folder, names, shard))
    except (OSError, ValueError):
        return False


def _other_arrays(folder, names):
    """Names of arrays of an earlier dataset that the new one does not have."""
    paths = folder.iterdir() if folder.is_dir() else ()
    return [path.name for path in paths if path.name not in (UNFINISHED, *names) and (path / ROOT).is_file()]
