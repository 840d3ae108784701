"""Dataset of the chips of a study, written shard by shard, which can be interrupted and resumed."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr

from fifesim.base.arguments import FilePath, Kind, WholeNumber, described, is_a
from fifesim.base.messages import warn
from fifesim.grids.chunks import found_client
from fifesim.ground.landscape.autoregression import FIELD_TILE
from fifesim.output import identity
from fifesim.output.blocks import has_blocks, is_saved, open_blocks, save_block
from fifesim.output.chips import store
from fifesim.output.chips.makers import made_shards, processes, workers_of
from fifesim.output.folders import BEGUN, UNFINISHED, check_folder, errors_with_their_file, results
from fifesim.output.progress import Progress
from fifesim.output.terminal import interrupts_blocked
from fifesim.scenario.chips import chips_of
from fifesim.scenario.ground import warn_of_canopy
from fifesim.scenario.studies import Study, StudyLike, read_study

STUDY = "study.toml"
# Files of version 0.2.0, which must not stay next to a new dataset.
_EARLIER = ["datasheet.html", "contact_sheet.png"]

WHOLE = (STUDY, store.ROOT)
"""Files that mark a dataset as complete."""

# Number of chips that are validated before the first is made, and number of these that are validated completely.
_LOOKED_AT, _CLOSELY = 1000, 50


def dataset(
    study: StudyLike,
    folder: FilePath,
    n: int = 1000,
    *,
    overwrite: bool = False,
    resume: bool = False,
    workers: WholeNumber = 1,
    client: Annotated[Any, Kind("a distributed.Client", lambda client: is_a(client, "Client"))] = None,
) -> xr.Dataset:
    """
    Create a training set: images and truth of the chips of a study, as sharded Zarr.

    Parameters
    ----------
    study : str, path or fifesim.Study
    folder : str or path
        Folder for the Zarr store and study.toml. It is created if needed.
    n : int, optional
        Number of chips.
    overwrite : bool, optional
        Replace an existing dataset in the folder.
    resume : bool, optional
        Resume an interrupted run of the same study in this folder, or start one. Nothing is done if the dataset is
        complete.
    workers : int, optional
        Number of worker processes on this machine. In a script, call the function below ``if __name__ == "__main__":``,
        because the processes import the script.
    client : distributed.Client, optional
        Client of a cluster; by default the current client, if any.

    Returns
    -------
    dataset : xarray.Dataset
        Lazy, along ``chip``: digital numbers ``dn``, ``toa_reflectance`` and ``ndvi`` of the image; ``lai``, ``fpar``
        and other true ground properties of the pixels; and as coordinates the drawn values, ``landscape`` and
        ``split``.

    Raises
    ------
    ValueError
        If the study is invalid, the folder has other contents, or both workers and a client are given. Nothing is
        written in this case.
    OSError
        If a file cannot be read or written. Finished shards are kept.

    Notes
    -----
    Chip k is identical to `fifesim.simulate` of ``fifesim.scenario.chips_of(study, n).scenario(k)``, for any number of
    workers. Truth and reflectance are stored in single precision.

    Examples
    --------
    >>> from fifesim import dataset
    >>> chips = dataset("study.toml", "chips.zarr", 10_000)  # doctest: +SKIP
    >>> train = chips.sel(chip=chips.split == "train")  # doctest: +SKIP
    """
    study = study if isinstance(study, Study) else read_study(study)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ValueError(f"workers must be an integer of at least 1, got {described(workers)}")
    if workers > 1 and client is not None:
        raise ValueError("workers starts processes and client uses a running cluster: give one of them")
    dataset_to_folder(study, folder, n, overwrite=overwrite, resume=resume, workers=workers, client=client)
    return xr.open_zarr(folder)


def dataset_to_folder(study, folder, count, *, overwrite=False, resume=False, workers=None, client=None, as_json=False):
    """Make the chips of a study in a folder; return the paths of the folder and its study."""
    folder = Path(folder)
    if check_folder(folder, overwrite, resume, WHOLE):
        _check_finished(folder, chips_of(study, count))
        return [folder, folder / STUDY]
    # One worker is this process.
    own = workers is not None and workers > 1
    client = None if own else client or found_client()
    with processes(workers) if own else workers_of(client) if client else nullcontext() as makers:
        # The compiled Sobol generator of scipy swallows KeyboardInterrupt.
        with interrupts_blocked():
            chips = chips_of(study, count)
        _look_at(chips)
        _warn_of_empty_parts(chips)
        layout = store.layout_of(chips)
        # The root marks the folder as a store and is therefore moved last.
        names = [*store.stored_names(chips, layout), STUDY, store.ROOT]
        earlier = folder.iterdir() if folder.is_dir() and (overwrite or resume) else ()
        # Arrays of an earlier dataset that the new one does not have.
        arrays = (
            path.name for path in earlier if path.name not in (UNFINISHED, *names) and (path / store.ROOT).is_file()
        )
        stale = [*arrays, *_EARLIER]
        kept = results(folder, names, overwrite=overwrite, resume=resume, worth_keeping=has_blocks, stale=stale)
        with errors_with_their_file(folder), kept as unfinished:
            _make(chips, layout, unfinished, as_json, makers)
    return [folder, folder / STUDY]


def _check_finished(folder, chips):
    """Raise ValueError if a finished dataset is not the requested one."""
    identity.check_finished(folder / STUDY, read_study(folder / STUDY).to_toml(), chips.study.to_toml(), _inputs(chips))
    if (found := store.chips_in(folder)) != len(chips):
        raise ValueError(
            f"{folder} holds a finished dataset of {found} chips, not {len(chips)}: give that number, name another "
            "folder with -o, or make it again with --overwrite"
        )
    if lacking := store.incomplete_variables(folder):
        raise ValueError(f"{folder} lacks files of {', '.join(lacking)}: make it again with --overwrite")


def _make(chips, layout, folder, as_json, makers):
    """Make the dataset in a folder that may hold a part of it."""
    study = chips.study
    state = identity.state_of(_inputs(chips), study.to_toml(), chips=len(chips))
    identity.begin(folder, state)
    for path in folder.rglob("*.partial"):
        # Left by a killed run.
        if path.is_file():
            path.unlink()
    rows, columns = study.scenario.geobox().shape
    # It is fastest to make all chips from one tile of each landscape together.
    together = max(FIELD_TILE // rows, 1) * max(FIELD_TILE // columns, 1) * study.landscapes
    shards = store.Shards(len(chips), layout.size, together)
    store.make_store(folder, chips, layout, shards)
    _compute(chips, layout, shards, folder, as_json, makers)
    (folder / STUDY).write_text(study.to_toml(), encoding="utf-8")
    identity.check_inputs(json.loads(state[identity.STATE])["inputs"], _inputs(chips))


def study_to_resume(folder):
    """Study of an unfinished or finished run, and its number of chips; None if there is no run."""
    folder = Path(folder)
    if (folder / UNFINISHED / BEGUN).is_file():
        count = identity.kept_json(folder / UNFINISHED / identity.STATE).get("chips")
        return read_study(folder / UNFINISHED / BEGUN), count if isinstance(count, int) else None
    if all((folder / name).is_file() for name in (STUDY, store.ROOT)):
        return read_study(folder / STUDY), store.chips_in(folder)
    return None, None


def _look_at(chips):
    """Validate the scenarios of some chips before the work starts."""
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
        raise ValueError(f"chip {last}: {error}; use more landscapes, so that chips are closer together") from None


def _warn_of_empty_parts(chips):
    """Warn of parts of the split without chips: the first chips are in different landscapes, each in one part."""
    empty, count = sorted(set(chips.study.split) - set(chips.split)), chips.study.landscapes
    if empty:
        warn(
            f"no chip for {' and '.join(empty)}: {len(chips)} chips are in as many of {count} landscapes, and each "
            f"landscape belongs to one part of the split. Make {count} chips or more (-n), or use fewer landscapes"
        )


def _inputs(chips):
    """Input files of the chips, including the files among which one is drawn."""
    study, found = chips.study, identity.inputs_of(chips.study.scenario)
    for key, distribution in study.drawn.items():
        if key.entry is None and any(key.section.names_a_file(key.key, value) for value in distribution.extremes):
            for value in distribution.extremes:
                found |= identity.inputs_of(study.scenario_with({key.path: value}))
    return found


def _compute(chips, layout, shards, folder, as_json, makers):
    """Make and write the missing shards."""
    arrays = {name: open_blocks(folder, name) for name in layout.variables}
    wanted = [shard for shard in range(len(shards)) if not all(is_saved(array, (shard,)) for array in arrays.values())]
    done = len(chips) - sum(np.diff(shards.range_of(shard)).item() for shard in wanted)
    with Progress("making chips", "chips", len(chips), done, as_json) as progress:
        for shard, made in made_shards(chips, layout, shards, wanted, progress.advance, makers):
            for name, values in made.items():
                save_block(arrays[name], (shard,), values)
