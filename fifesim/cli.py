"""The command line. Everything slow to import is imported by the command that needs it, so that --help is instant."""

import json
import os
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="Simulate what a satellite would have seen.", no_args_is_help=True, add_completion=False, rich_markup_mode=None
)


class Exit(IntEnum):
    """Exit codes: what was asked cannot be done, what could be done failed, and somebody pressed Ctrl-C."""

    MISTAKE = 2
    FAILURE = 1
    INTERRUPTED = 130


def _version(asked: bool):
    if asked:
        from fifesim import __version__

        typer.echo(f"fifesim {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
):
    pass


@app.command()
def simulate(
    scenario: Annotated[Path | None, typer.Argument(help="TOML file; the whole FIFE site by default.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("fife"),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier run.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a run that was stopped.")] = False,
    scene: Annotated[bool, typer.Option("--scene", help="Write the cells too: scene.zarr.")] = False,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; one for each core by default.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Compute on so many processes.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Compute on a dask cluster, such as tcp://head:8786.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print progress as lines of JSON.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only estimate time, memory and disk.")] = False,
):
    """Simulate a scenario: image.tif, truth.tif, quicklook.png, report.html, scenario.toml."""
    _check_spelling(scenario)

    from fifesim.output.folders import check_folder
    from fifesim.output.run.estimates import estimate, estimate_in_words
    from fifesim.output.run.folder import scenario_to_resume, simulate_to_folder
    from fifesim.output.run.workers import cluster
    from fifesim.scenario.scenario import Scenario, read_scenario

    with _errors_in_one_line(output):
        check_folder(output, overwrite, resume)
        found = scenario_to_resume(output) if resume and scenario is None else None
        found = found or (Scenario() if scenario is None else read_scenario(scenario))
        if dry_run:
            typer.echo(estimate_in_words(estimate(found, threads=workers or threads, scene=scene), as_json))
            return
        found.complete()
        with cluster(workers, scheduler) as client:
            options = {"overwrite": overwrite, "resume": resume, "scene": scene, "as_json": as_json}
            files = simulate_to_folder(found, output, threads=threads, client=client, **options)
    if as_json:
        typer.echo(json.dumps({"event": "finished", "files": [str(path) for path in files]}))
        return
    for path in files:
        typer.echo(path)


@app.command()
def reproduce(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("friedl1995"),
    realisations: Annotated[int, typer.Option(help="How many of each of the nine scenes.")] = 20,
    cells: Annotated[int, typer.Option(help="Along the edge of a scene, of 3.33 m each.")] = 333,
    seed: Annotated[int, typer.Option(help="Of the first realisation; the others follow.")] = 1995,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier run.")] = False,
):
    """Repeat the paper: table2.csv, figure3.png to figure9.png, report.html."""
    from fifesim.experiments.friedl1995.folder import reproduce_to_folder

    try:
        files = reproduce_to_folder(output, realisations=realisations, cells=cells, seed=seed, overwrite=overwrite)
    except ValueError as error:
        _stop(error, Exit.MISTAKE)
    except (OSError, MemoryError) as error:
        _stop(error, Exit.FAILURE)
    for path in files:
        typer.echo(path)


@app.command()
def budget(
    scenario: Annotated[Path | None, typer.Argument(help="TOML file; the paper's case by default.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("budget"),
    realisations: Annotated[int, typer.Option(help="How many scenes.")] = 20,
    cells: Annotated[int, typer.Option(help="Along the edge of a scene.")] = 333,
    seed: Annotated[int | None, typer.Option(help="Of the first scene; the scenario's by default.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier run.")] = False,
):
    """Find where the scatter comes from, stage by stage: budget.csv, budget.png, report.html, scenario.toml."""
    _check_spelling(scenario)

    from fifesim.experiments.scatter.folder import budget_to_folder
    from fifesim.scenario.scenario import read_scenario

    try:
        found = None if scenario is None else read_scenario(scenario)
        options = {"realisations": realisations, "cells": cells, "seed": seed}
        files = budget_to_folder(found, output, overwrite=overwrite, **options)
    except ValueError as error:
        _stop(error, Exit.MISTAKE)
    except (OSError, MemoryError, RuntimeError, ImportError) as error:
        _stop(error, Exit.FAILURE)
    for path in files:
        typer.echo(path)


@app.command()
def scenario():
    """Print the default scenario, every key with its unit, to edit."""
    from fifesim.scenario.scenario import Scenario
    from fifesim.scenario.toml import write_scenario

    typer.echo(write_scenario(Scenario().complete()), nl=False)


@app.command()
def sensors(
    name: Annotated[str | None, typer.Argument(help="Name or alias of one, or its file; all by default.")] = None,
    check: Annotated[Path | None, typer.Option("--check", help="Check a file of your own, and say what it is.")] = None,
):
    """List the instruments, or one in detail: bands, sampling, point spread, radiometry, noise, sources."""
    from fifesim.sensor.description.instruments import instrument, instrument_names, read_instrument
    from fifesim.sensor.description.listing import instrument_in_words, list_instruments

    try:
        if check is not None:
            found = instrument_in_words(read_instrument(check))
            text = f"{found}\n{check} is right: every number has a source, and none looks like another unit."
        elif name is not None:
            text = instrument_in_words(instrument(name))
        else:
            text = list_instruments([instrument(each) for each in instrument_names()])
    except (ValueError, OSError) as error:
        _stop(error, Exit.MISTAKE)
    typer.echo(text)


@app.command()
def verify():
    """Check this installation against independent results; exit code 1 where one deviates more than it may."""
    # The matrices are small: threads of BLAS, loaded only now, would wait for each other longer than they work.
    os.environ.setdefault("OMP_NUM_THREADS", "1")

    from fifesim.experiments.verification.areas import deviations
    from fifesim.experiments.verification.listing import HEADING, by_stage, summary

    found = []
    try:
        typer.echo(HEADING)
        for text in by_stage(_kept(deviations(), found)):
            typer.echo(text)
    except OSError as error:
        _stop(error, Exit.FAILURE)
    typer.echo(summary(found))
    if not all(deviation.within for deviation in found):
        raise typer.Exit(Exit.FAILURE)


def _kept(items, kept):
    """Items as they come, which go into a list too."""
    for item in items:
        kept.append(item)
        yield item


def _check_spelling(scenario):
    """A typing error is told before anything slow is imported."""
    from fifesim.scenario.toml import check_spelling

    try:
        if scenario is not None:
            check_spelling(scenario)
    except ValueError as error:
        _stop(error, Exit.MISTAKE)


@contextmanager
def _errors_in_one_line(output):
    try:
        yield
    except ValueError as error:
        _stop(error, Exit.MISTAKE)
    except (OSError, MemoryError, RuntimeError, ImportError) as error:
        _stop(error, Exit.FAILURE)
    except KeyboardInterrupt:
        _stop(f"interrupted; what is finished is kept, go on with --resume -o {output}", Exit.INTERRUPTED)


def _stop(error, code):
    typer.echo(f"fifesim: {error}", err=True)
    raise typer.Exit(code) from None
