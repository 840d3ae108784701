"""The command line. Each command imports its slow modules itself, so that --help is instant."""

import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from fifesim.output.terminal import (
    Commands,
    Exit,
    Quiet,
    Verbose,
    exit_with_error,
    importing,
    kept,
    print_lines,
    report,
)

app = typer.Typer(
    cls=Commands,
    help="Simulate satellite images of vegetated land, with the true LAI and FPAR of each pixel.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _command(name, *examples):
    """Decorator of a command, with examples at the end of its help."""
    lines = [f"  fifesim {name} {each}".rstrip() for each in examples]
    return app.command(name, epilog="\n".join(["\b", "Example:" if len(lines) == 1 else "Examples:", *lines]))


# One BLAS thread, also in scipy and in worker processes: dask has a thread for each core, and on small matrices BLAS
# threads spend more time waiting than working. A number set by the user stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_Paper = Annotated[bool, typer.Option("--paper", help="Use the paper's stand instead of the default landscape.")]
_Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier run.")]
_Resume = Annotated[bool, typer.Option("--resume", help="Resume an interrupted run.")]
_Scheduler = Annotated[
    str | None, typer.Option(help="Address of a dask scheduler to compute on, such as tcp://head:8786.")
]
_AsJson = Annotated[bool, typer.Option("--json", help="Print progress as JSON lines.")]
_Threads = Annotated[int | None, typer.Option(min=1, help="Number of threads; by default one per core.")]


def _open_remote(context: typer.Context, wanted: bool):
    if wanted:
        from fifesim.grids.opening import remote_allowed

        context.with_resource(remote_allowed())


_AllowRemote = Annotated[
    bool,
    typer.Option(
        "--allow-remote", callback=_open_remote, help="Allow remote rasters and all GDAL formats, for files you trust."
    ),
]


def _version(wanted: bool):
    if wanted:
        from fifesim import __version__

        print_lines(f"fifesim {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
):
    pass


@_command("simulate", "", "mine.toml -o run --threads 4")
def simulate_command(
    scenario: Annotated[
        Path | None, typer.Argument(help="Scenario file (TOML); by default a synthetic landscape at the FIFE site.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("fife"),
    overwrite: _Overwrite = False,
    resume: _Resume = False,
    scene: Annotated[bool, typer.Option("--scene", help="Also write the ground cells, as scene.zarr.")] = False,
    threads: _Threads = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Number of worker processes.")] = None,
    scheduler: _Scheduler = None,
    as_json: _AsJson = False,
    paper: _Paper = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only estimate time, memory and disk.")] = False,
    allow_remote: _AllowRemote = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Simulate an image. Writes image.tif, truth.tif, quicklook.png, report.html, scenario.toml, item.json (STAC)."""
    start = time.monotonic()
    _check_spelling(scenario)

    with importing():
        from fifesim.output.folders import check_folder
        from fifesim.output.identity import scenario_to_resume
        from fifesim.output.progress import since_start
        from fifesim.output.run_folder import estimate, estimate_in_words, names_of, simulate_to_folder
        from fifesim.output.workers import cluster

    check_folder(output, overwrite, resume, names_of(scene))
    found = scenario_to_resume(output) if resume and scenario is None and not paper else None
    found = found or _scenario(scenario, paper)
    if dry_run:
        cost = estimate(found, output, threads=workers or threads, scene=scene, start=since_start())
        print_lines(estimate_in_words(cost, as_json))
        return
    found.complete()
    with kept(output), cluster(workers, scheduler) as client:
        files, finished = simulate_to_folder(
            found, output, overwrite=overwrite, resume=resume,
            scene=scene, threads=threads, client=client, as_json=as_json,
        )  # fmt: skip
    look = f"{output / 'report.html'} in a browser, {output / 'image.tif'} in a GIS"
    report(files, time.monotonic() - start, look, as_json, finished)


@_command("rerun", "fife/image.tif")
def rerun_command(
    file: Annotated[Path, typer.Argument(help="File image.tif or truth.tif of a run.")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Save the new file under this name.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
    threads: _Threads = None,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Recompute a file of a run from its tags. The exit code is 1 if any value differs."""
    with importing():
        from fifesim.output.reproduction import outcome_in_words, rerun

    found = rerun(file, output, overwrite=overwrite, threads=threads)
    print_lines(outcome_in_words(file, found))
    if found.differing:
        raise typer.Exit(Exit.FAILURE)


@_command("dataset", "study.toml -o chips.zarr -n 200")
def dataset_command(
    study: Annotated[
        Path | None, typer.Argument(help="Study file (TOML): a scenario with a table [draw] of distributions.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the chips (Zarr store).")] = Path(
        "chips.zarr"
    ),
    chips: Annotated[int | None, typer.Option("-n", "--chips", min=1, help="Number of chips; 1000 by default.")] = None,
    overwrite: _Overwrite = False,
    resume: _Resume = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Number of worker processes; by default one per core.")
    ] = None,
    scheduler: _Scheduler = None,
    as_json: _AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Create a training set. Writes images and truth of many chips as sharded Zarr, with the study."""
    start = time.monotonic()
    with importing():
        from fifesim.output.chips.folder import WHOLE, dataset_to_folder, study_to_resume
        from fifesim.output.folders import check_folder
        from fifesim.output.workers import cluster, usable_cores
        from fifesim.scenario.studies import read_study

    finished = check_folder(output, overwrite, resume, WHOLE)
    found, count = study_to_resume(output) if resume else (None, None)
    if study is None and found is None:
        raise ValueError(
            "a study is missing: give its file, such as study.toml, or resume a dataset with --resume and -o"
        )
    found = found if study is None else read_study(study)
    if scheduler is None:
        workers = workers or usable_cores()
    elif workers is not None:
        raise ValueError("--workers starts processes and --scheduler uses a running cluster: give one of them")
    with kept(output), cluster(scheduler=scheduler) as client:
        count = chips or count or 1000
        files = dataset_to_folder(
            found, output, count, overwrite=overwrite, resume=resume, workers=workers, client=client, as_json=as_json
        )
    report(files, time.monotonic() - start, f"{output} with xarray.open_zarr", as_json, finished)


@_command("reproduce", "--reading aligned --realisations 5 -o table2")
def reproduce_command(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("friedl1995"),
    reading: Annotated[str, typer.Option(help="Interpretation of Table 1: native or aligned.")] = "native",
    dem: Annotated[str, typer.Option(help="Elevation: flat, flint-hills (synthetic), or a raster file.")] = "flat",
    densities: Annotated[
        Path | None, typer.Option(help="Folder of LAI samples: burned-grazed.csv and so on; inferred by default.")
    ] = None,
    optics: Annotated[
        Path | None, typer.Option(help="CSV file: band,leaf_reflectance,leaf_transmittance; fitted by default.")
    ] = None,
    background: Annotated[
        str | None,
        typer.Option(help="CSV file: band,background; or a mixture, soil_dry:0.5+shade:0.5; fitted by default."),
    ] = None,
    sensor: Annotated[
        str, typer.Option(help="Name or file of an instrument with a red and a near infrared band.")
    ] = "TM",
    west: Annotated[
        float | None, typer.Option(help="Easting of the scenes in EPSG:26914, which determines the relief.")
    ] = None,
    north: Annotated[float | None, typer.Option(help="Northing of the upper edge of the scenes.")] = None,
    realisations: Annotated[int, typer.Option(help="Realisations of each of the nine scenes.")] = 20,
    cells: Annotated[int | None, typer.Option(help="Cells (3.33 m) along the edge of a scene; 333 for TM.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the first realisation; the others count up.")] = 1995,
    scenes: Annotated[
        bool, typer.Option("--scenes", help="Also simulate each scenario: image, truth and scene.")
    ] = False,
    overwrite: _Overwrite = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Reproduce Friedl and others (1995). Writes table2.csv, data of Figures 3 to 9, nine scenarios, report.html."""
    start = time.monotonic()

    with importing():
        from fifesim.experiments.friedl1995.report import reproduce_to_folder

    files = reproduce_to_folder(
        output, reading=reading, dem=dem, densities=densities, optics=optics, background=background,
        sensor=sensor, west=west, north=north, realisations=realisations, cells=cells, seed=seed,
        scenes=scenes, overwrite=overwrite,
    )  # fmt: skip
    report(files, time.monotonic() - start, f"{output / 'report.html'} in a browser")


@_command("budget", "mine.toml --realisations 40", "--sensor MSI -o msi")
def budget_command(
    scenario: Annotated[Path | None, typer.Argument(help="Scenario file (TOML); by default as simulate.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("budget"),
    realisations: Annotated[int, typer.Option(help="Number of scenes.")] = 20,
    cells: Annotated[
        int | None, typer.Option(help="Cells along the edge of a scene; 333, or 12 pixels of a coarse sensor.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first scene; by default from the scenario.")] = None,
    sensor: Annotated[
        str | None, typer.Option(help="Instrument over level ground, or of the raster of --like.")
    ] = None,
    like: Annotated[
        Path | None, typer.Option(help="Raster file of LAI or NDVI from which the ground is learned.")
    ] = None,
    dem: Annotated[Path | None, typer.Option(help="Elevation file that covers the raster of --like.")] = None,
    when: Annotated[str | None, typer.Option("--time", help="Its time, such as 2022-06-03T17:15Z.")] = None,
    noise: Annotated[float, typer.Option(help="Standard deviation of its noise, in its unit.")] = 0.0,
    paper: _Paper = False,
    overwrite: _Overwrite = False,
    allow_remote: _AllowRemote = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Attribute the scatter of LAI and FPAR to stages. Writes budget.csv, budget.png, report.html, scenario.toml."""
    start = time.monotonic()
    _check_spelling(scenario)
    if (sensor or like) and (scenario or paper):
        raise ValueError("--sensor and --like cannot be combined with a scenario file or --paper: give one of them")
    if (dem or when or noise) and not like:
        raise ValueError("--dem, --time and --noise belong to --like: give the raster from which the ground is learned")

    with importing():
        from fifesim.experiments.scatter.report import budget_to_folder
        from fifesim.experiments.scatter.shares import instrument_scenario, scenario_like, window_cells

    with TemporaryDirectory() as folder:
        if like:
            file = Path(folder) / "landscape.json"
            found = scenario_like(like, dem, file=file, instrument=sensor, time=when, noise=noise)
        else:
            found = instrument_scenario(sensor) if sensor else _scenario(scenario, paper)
        if cells is None:
            cells = window_cells(found) if sensor else 333
        files = budget_to_folder(found, output, realisations=realisations, cells=cells, seed=seed, overwrite=overwrite)
    report(files, time.monotonic() - start, f"{output / 'report.html'} in a browser")


@_command("endtoend", "--quantity evapotranspiration -o et")
def endtoend_command(
    scenario: Annotated[Path | None, typer.Argument(help="Scenario file (TOML); by default as simulate.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the results.")] = Path("endtoend"),
    quantity: Annotated[
        str, typer.Option(help="gpp, evapotranspiration, or one of their models such as photosynthesis or pt-jpl.")
    ] = "gpp",
    retrieval: Annotated[
        Path | None, typer.Option(help="Trained retrieval (NetCDF); by default a line on NDVI.")
    ] = None,
    realisations: Annotated[int, typer.Option(help="Number of scenes.")] = 20,
    cells: Annotated[int, typer.Option(help="Cells along the edge of a scene.")] = 333,
    seed: Annotated[int | None, typer.Option(help="Seed of the first scene; by default from the scenario.")] = None,
    paper: _Paper = False,
    overwrite: _Overwrite = False,
    allow_remote: _AllowRemote = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Attribute errors of GPP or evapotranspiration to stages. Writes a report with bias, variance and maps."""
    start = time.monotonic()
    _check_spelling(scenario)

    with importing():
        from fifesim.experiments.scatter.endtoend import endtoend_to_folder
        from fifesim.retrieval.description import read_retrieval

    files = endtoend_to_folder(
        _scenario(scenario, paper), output, quantity=quantity,
        retrieval="line" if retrieval is None else read_retrieval(retrieval), realisations=realisations, cells=cells,
        seed=seed, overwrite=overwrite,
    )  # fmt: skip
    report(files, time.monotonic() - start, f"{output / 'report.html'} in a browser")


@_command("explore", "mine.toml -o mine.html")
def explore_command(
    scenario: Annotated[Path | None, typer.Argument(help="Scenario file (TOML); by default as simulate.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="HTML file to write.")] = Path("explore.html"),
    paper: _Paper = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing page.")] = False,
    allow_remote: _AllowRemote = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
):
    """Write an interactive page. It has sliders for ground, atmosphere, sun, instrument and registration."""
    start = time.monotonic()
    _check_spelling(scenario)

    with importing():
        from fifesim.experiments.explorer import explore

    page = explore(_scenario(scenario, paper), output, overwrite=overwrite)
    report([page], time.monotonic() - start, f"{page} in a browser")


@_command("scenario", "> mine.toml")
def scenario_command(paper: _Paper = False):
    """Print the default scenario as TOML. Every key has its unit and meaning; save it to a file and edit."""
    # From a file, because the scenario takes 2 s to compute; the tests compare both.
    path = Path(__file__).with_name("scenario") / ("paper.toml" if paper else "default.toml")
    print_lines(path.read_text(encoding="utf-8").rstrip())


@_command("sensors", "OLI", "--check mine.toml")
def sensors_command(
    name: Annotated[str | None, typer.Argument(help="Name, alias or file of an instrument; by default all.")] = None,
    check: Annotated[Path | None, typer.Option("--check", help="Check an instrument file and print it.")] = None,
):
    """List all instruments, or describe one. Shows bands, sampling, point spread, radiometry, noise and sources."""
    from fifesim.sensor.description.instruments import instrument, instrument_names, read_instrument
    from fifesim.sensor.description.listing import instrument_in_words, list_instruments

    if check is not None:
        print_lines(instrument_in_words(read_instrument(check)))
        print_lines(f"{check} is valid: every number has a source and a plausible unit.")
    elif name is not None:
        print_lines(instrument_in_words(instrument(name)))
    else:
        print_lines(list_instruments([instrument(known) for known in instrument_names()]))


@_command("verify", "")
def verify_command():
    """Compare this installation with independent results. The exit code is 1 if a deviation exceeds its bound."""
    with importing():
        from fifesim.experiments.verification import listing, verify

    try:
        found = verify()
    except FileNotFoundError as error:
        # A table missing from the installation is a failure, not an invalid request.
        exit_with_error(error, Exit.FAILURE)
    print_lines(*listing(found))
    if not all(deviation.within for deviation in found):
        raise typer.Exit(Exit.FAILURE)


def _scenario(path, paper):
    """Scenario of a file, of the paper, or the default one."""
    if path is not None and paper:
        raise ValueError('--paper cannot be combined with a scenario file: write base = "paper" at its top instead')

    from fifesim.scenario.scenario import Scenario, default_scenario, read_scenario

    if path is not None:
        return read_scenario(path)
    return Scenario(base="paper") if paper else default_scenario()


def _check_spelling(scenario):
    """Report misspelt keys before slow modules are imported."""
    from fifesim.scenario.toml import check_spelling

    if scenario is not None:
        check_spelling(scenario)
