"""Command line: files, exit codes and one-line error messages."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
import rasterio
import typer
from typer.testing import CliRunner

from fifesim.base import files
from fifesim.base.messages import warn
from fifesim.cli import app
from fifesim.output import report
from fifesim.output.reproduction import Rerun
from fifesim.output.run_folder import FILES
from fifesim.scenario.scenario import Scenario, default_scenario, read_scenario
from fifesim.scenario.toml import write_scenario

SMALL = """
[grid]
width = 900
height = 600

[ground]
arp = 0.24
seed = 3
"""


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        return CliRunner().invoke(app, list(map(str, arguments)))

    return call


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """Output folder and result of a run of the small scenario."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "small.toml").write_text(SMALL)
    return folder / "out", CliRunner().invoke(app, ["simulate", str(folder / "small.toml"), "-o", str(folder / "out")])


def test_simulate_writes_and_lists_its_files(first):
    """The last line states the duration and the files to open."""
    out, result = first
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    assert all(name in result.output for name in FILES)
    said = rf"done in \d[\w. ]* s: open {out}/report\.html in a browser, {out}/image\.tif in a GIS"
    assert re.fullmatch(said, result.stdout.splitlines()[-1])
    with rasterio.open(out / "image.tif") as image:
        assert image.crs.to_epsg() == 26914 and tuple(image.bounds) == (704970.0, 4333620.0, 705870.0, 4334220.0)
        assert image.descriptions == ("TM2", "TM3", "TM4")
        # The footprints of edge pixels extend beyond the scene.
        assert image.read()[:, 1:-1, 1:-1].min() > 0


def test_rerun_reproduces_the_file(first, invoke, monkeypatch, tmp_path):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    result = invoke("rerun", first[0] / "image.tif", "-o", "again.tif")
    assert result.exit_code == 0, result.output
    assert result.stdout == f"{first[0]}/image.tif made again: the same bits in all of 1800 values\n"
    assert (tmp_path / "again.tif").read_bytes() == (first[0] / "image.tif").read_bytes()
    refused = invoke("rerun", first[0] / "image.tif", "-o", "again.tif")
    assert refused.exit_code == 2 and "--overwrite" in refused.stderr
    # Different values exit with code 1.
    monkeypatch.setattr("fifesim.output.reproduction.rerun", lambda *given, **options: Rerun(1200, 3, 1.0, {}))
    result = invoke("rerun", first[0] / "image.tif")
    assert result.exit_code == 1
    assert "3 of 1200 values differ, by 1 at most; the versions are the same" in result.stdout


def test_quiet_prints_nothing_and_verbose_prints_steps(invoke, small, monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    quiet = invoke("simulate", small, "-o", "quiet", "--quiet")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", "")
    told = invoke("simulate", small, "-o", "told", "-v")
    assert "180 x 270 cells" in told.stderr and "blocks to make, 0 are saved" in told.stderr
    assert "saved block (" not in told.stderr
    assert "saved block (" in invoke("simulate", small, "-o", "all", "-vv").stderr
    assert invoke("simulate", small, "-o", "quiet", "--quiet").exit_code == 2
    monkeypatch.setattr("fifesim.experiments.explorer.explore", lambda scenario, page, overwrite: page)
    assert "open page.html in a browser" in invoke("explore", "-o", "page.html").stdout
    assert invoke("explore", "-o", "page.html", "--quiet").stdout == ""


def test_commands_with_output_have_quiet_and_verbose():
    for command in typer.main.get_command(app).commands.values():
        options = {each for known in command.params for each in known.opts}
        assert "--output" not in options or {"--quiet", "--verbose"} <= options, command.name


def test_list_of_commands_has_whole_sentences():
    """Click shortens a description to one line, which ends at a full stop or with three dots."""
    lines = CliRunner(env={"COLUMNS": "80"}).invoke(app, ["--help"]).stdout.partition("Commands:\n")[2].splitlines()
    commands = typer.main.get_command(app).commands
    assert [line.split()[0] for line in lines] == list(commands)
    for line, command in zip(lines, commands.values(), strict=True):
        assert command.help.startswith(line.split(maxsplit=1)[1]) and re.search(r"\w{3,}\)?\.$", line), line
        assert "et al." not in line


def test_help_of_each_command_ends_with_valid_examples():
    for name, command in typer.main.get_command(app).commands.items():
        shown = CliRunner(env={"COLUMNS": "80"}).invoke(app, [name, "--help"]).stdout
        examples = re.findall(r"^    fifesim (\w+) ?(.*)$", shown.partition("Example")[2], re.MULTILINE)
        assert examples and {each for each, _ in examples} == {name}
        for _, arguments in examples:
            command.make_context(name, arguments.partition(">")[0].split())
        assert "[default: 0]" not in shown
    with pytest.raises(Exception, match="No such option"):
        command.make_context(name, ["--nonsense"])


def test_written_scenario_reproduces_the_files(first, invoke, tmp_path):
    assert invoke("simulate", first[0] / "scenario.toml", "-o", "again").exit_code == 0
    for name in FILES:
        assert (first[0] / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


def test_printed_scenario_is_the_default_one(invoke, tmp_path):
    """The files in ``fifesim/scenario`` hold the texts of `write_scenario`: write them again when a key changes."""
    printed = invoke("scenario").stdout
    assert printed == write_scenario(default_scenario().complete())
    (tmp_path / "default.toml").write_text(printed)
    assert write_scenario(read_scenario(tmp_path / "default.toml")) == printed
    assert 'learned = "konza"' in printed and "distribution =" not in printed
    paper = invoke("scenario", "--paper").stdout
    assert paper == write_scenario(Scenario(base="paper").complete())
    assert (
        'learned = "none"' in paper and 'distribution = "burned-grazed"' in paper and 'bands = ["TM3", "TM4"]' in paper
    )


def test_sensors_lists_instruments_or_bands(invoke):
    lines = invoke("sensors").stdout.splitlines()
    names = [line.split()[0] for line in lines[1:]]
    assert {"TM", "L4TM", "ETM+", "OLI", "OLI2", "MSI", "MSI-B", "HRV", "MODIS", "MODIS-Aqua", "AVHRR"} <= set(names)
    assert max(map(len, lines)) <= 120
    printed = invoke("sensors", "Landsat-5 TM").stdout
    assert "TM4" in printed and "206.20" in printed


def test_invalid_instrument_files_exit_with_2_and_one_line(invoke, tmp_path):
    text = files.path("instruments/oli.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("altitude = 705000.0", "altitude = 705.0"), encoding="utf-8")
    mistakes = {
        "mine.toml: altitude = 705: it is in metres": ["sensors", "--check", "mine.toml"],
        str(tmp_path): ["sensors", "--check", str(tmp_path)],
    }
    for said, arguments in mistakes.items():
        result = invoke(*arguments)
        assert result.exit_code == 2 and said in result.stderr, result.output
        assert len(result.stderr.strip().splitlines()) == 1


def test_sensors_check_summarizes_a_file(invoke, tmp_path):
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace('"AVHRR"', '"MINE"', 1), encoding="utf-8")
    result = invoke("sensors", "--check", "mine.toml")
    assert result.exit_code == 0, result.output
    assert "own interval 1124.880 along x 817.000 across m" in result.stdout
    assert "mine.toml is valid" in result.stdout


def test_existing_folder_needs_overwrite(invoke, small, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    kept = tmp_path / "out" / "notes.txt"
    kept.parent.mkdir()
    kept.write_text("mine")
    refused = invoke("simulate", small, "-o", "out")
    assert refused.exit_code == 2
    assert "--overwrite" in refused.stderr
    assert [path.name for path in kept.parent.iterdir()] == ["notes.txt"]
    assert invoke("simulate", small, "-o", "out", "--overwrite").exit_code == 0
    assert kept.read_text() == "mine"
    assert (tmp_path / "out" / "image.tif").exists()


def test_resuming_a_finished_run_reports_its_files(first, invoke):
    """A batch system may resubmit a finished run, which must not fail."""
    out = first[0]
    before = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    for scenario in ([], [out.parent / "small.toml"]):
        result = invoke("simulate", *scenario, "-o", out, "--resume")
        assert result.exit_code == 0, result.stderr
        assert all(name in result.stdout for name in FILES)
        assert "this run is already finished: open" in result.stdout
    assert {path.name: path.stat().st_mtime_ns for path in out.iterdir()} == before
    other = invoke("simulate", "--paper", "-o", out, "--resume")
    assert other.exit_code == 2 and "--overwrite" in other.stderr


def test_dry_run_estimates_and_writes_nothing(invoke, small, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    result = invoke("simulate", small, "-o", "out", "--dry-run", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert (found["cells"], found["pixels"]) == (270 * 180, 30 * 20)
    assert found["tasks"] > 0 and found["seconds"] > 0 and found["memory"] > 0
    assert not (tmp_path / "out").exists()
    assert "million" in invoke("simulate", small, "--dry-run").stdout


def test_json_reports_progress(invoke, small, monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    lines = [json.loads(line) for line in invoke("simulate", small, "-o", "out", "--json").stdout.splitlines()]
    assert {line["event"] for line in lines[:-1]} == {"progress"}
    assert lines[-1]["event"] == "finished"
    assert (lines[0]["cells_done"], lines[-2]["cells_done"]) == (0, 270 * 180)
    assert len(lines[-1]["files"]) == len(FILES)
    assert lines[-1]["seconds"] > 0


STUDY = """
[grid]
width = 180
height = 180

[terrain]
dem = "flat"

[dataset]
landscapes = 3

[draw]
visibility = { uniform = ["10 km", 60] }
"""


def test_dataset_writes_chips_and_lists_readable_files(invoke, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    result = invoke("dataset", "study.toml", "-n", 4, "--workers", 1, "--json")
    assert result.exit_code == 0, result.output
    *_, progress, last = map(json.loads, result.stdout.splitlines())
    assert progress["chips_done"] == progress["chips"] == 4
    assert last["files"] == ["chips.zarr", "chips.zarr/study.toml"]
    assert all((tmp_path / name).exists() for name in last["files"])
    again = invoke("dataset", "study.toml", "-n", 4, "--workers", 1)
    assert again.exit_code == 2 and "is not empty" in again.stderr
    finished = invoke("dataset", "--resume")
    assert finished.exit_code == 0 and "already finished" in finished.stdout


def write_lai(path, driver, values):
    """Map of LAI at the site, of 30 x 30 cells of 30 m."""
    profile = {"driver": driver, "width": 30, "height": 30, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    transform = rasterio.transform.from_origin(705000, 4334100, 30, 30)
    with rasterio.open(path, "w", **profile, transform=transform) as sink:
        sink.write(values.astype("float32"), 1)


def test_other_raster_formats_need_allow_remote(invoke, tmp_path):
    """The SAGA grid format is not among the formats allowed by default."""
    write_lai(tmp_path / "lai.sdat", "SAGA", np.random.default_rng(1).uniform(1, 3, (30, 30)))
    (tmp_path / "lai.toml").write_text('[ground]\nlai_file = "lai.sdat"\n')
    refused = invoke("simulate", "lai.toml", "-o", "out")
    assert refused.exit_code == 2 and "--allow-remote" in refused.stderr
    opened = invoke("simulate", "lai.toml", "-o", "out", "--allow-remote")
    assert opened.exit_code == 0, opened.stderr
    write_lai(tmp_path / "lai.sdat", "SAGA", np.full((30, 30), -1.0))
    negative = invoke("simulate", "lai.toml", "-o", "again", "--allow-remote")
    assert negative.exit_code == 2 and "negative" in negative.stderr and not (tmp_path / "again").exists()


def test_error_message_is_short_and_has_no_control_characters(invoke, tmp_path):
    (tmp_path / "wrong.toml").write_text('[ground]\n"\\u001b[31mred" = 1\n[grid]\ncrs = "\\u001b]0;title\\u0007"\n')
    (tmp_path / "long.toml").write_text("".join(f"[ground{number}]\nseed = 1\n" for number in range(300)))
    files_of_mistakes = ["simulate", "wrong.toml"], ["simulate", "long.toml"]
    for arguments in (*files_of_mistakes, ["sensors", "\x1b[31m"], ["simulate", "--\x1b[31m"], ["\x1b[2J"]):
        result = invoke(*arguments)
        assert result.exit_code == 2 and len(result.stderr) <= 520
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", result.output + result.stderr), arguments


# Commands and the functions that do their work.
REPORTS = {
    "reproduce": "experiments.friedl1995.report.reproduce_to_folder",
    "budget": "experiments.scatter.report.budget_to_folder",
    "endtoend": "experiments.scatter.endtoend.endtoend_to_folder",
}
LONG = REPORTS | {"verify": "experiments.verification.verify", "simulate": "output.run_folder.simulate_to_folder"}


@pytest.mark.parametrize("command", REPORTS)
def test_reports_list_their_files(invoke, monkeypatch, command):
    monkeypatch.setattr(f"fifesim.{REPORTS[command]}", lambda *arguments, **options: ["out/table.csv"])
    *files, last = invoke(command, "-o", "out").stdout.splitlines()
    assert files == ["out/table.csv"] and last.endswith("open out/report.html in a browser")


@pytest.mark.parametrize("command", LONG)
def test_ctrl_c_exits_with_130_and_one_line(invoke, monkeypatch, command):
    def pressed(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"fifesim.{LONG[command]}", pressed)
    result = invoke(command)
    assert result.exit_code == 130
    assert "interrupted; nothing was written" in result.stderr and "Traceback" not in result.stderr


def test_file_that_ends_early_is_not_taken_for_ctrl_c(invoke, small, monkeypatch):
    def short(*arguments, **options):
        raise EOFError("Ran out of input")

    monkeypatch.setattr("fifesim.output.run_folder.simulate_to_folder", short)
    result = invoke("simulate", small)
    assert result.exit_code == 1 and result.stderr == "fifesim: a file ends early: Ran out of input\n"


def test_warning_is_one_line(invoke, small, monkeypatch):
    """The warning has no source line and no control characters."""

    def told(*arguments, **options):
        warn("the sun is taken for that of June\x1b[31m")
        return [], False

    monkeypatch.setattr("fifesim.output.run_folder.simulate_to_folder", told)
    result = invoke("simulate", small)
    assert result.exit_code == 0
    assert result.stderr == "fifesim: warning: the sun is taken for that of June\\x1b[31m\n"


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that takes nothing is Linux's")
def test_full_standard_output_is_a_one_line_error():
    """Commands run one after the other in one process, which imports their modules once."""
    code = (
        "import os, sys\nfrom fifesim.cli import app\n"
        "for command in sys.argv[1:]:\n"
        "    os.dup2(os.open('/dev/full', os.O_WRONLY), 1)\n"
        "    try:\n"
        "        app([command])\n"
        "    except SystemExit as ended:\n"
        "        sys.stdout.flush()\n"
        "        print(ended.code, file=sys.stderr)\n"
    )
    command = [sys.executable, "-c", code, "scenario", "sensors", "verify"]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=True)
    lines = done.stderr.splitlines()
    assert lines[1::2] == ["1", "1", "1"]
    assert len(lines) == 6 and all("space" in line for line in lines[::2])


@pytest.mark.parametrize("given", [None, "2"])
def test_commands_use_one_blas_thread_by_default(given):
    """Also for numpy, which is imported earlier: its threads would mostly wait for each other."""
    given = {} if given is None else {"OPENBLAS_NUM_THREADS": given}
    code = (
        "from fifesim.cli import app, importing\nwith importing(): import scipy.linalg\n"
        "from threadpoolctl import threadpool_info\n"
        "print({each['num_threads'] for each in threadpool_info() if each['user_api'] == 'blas'})"
    )
    env = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")} | given
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert found.stdout.strip() == (f"{{{min(2, os.cpu_count())}}}" if given else "{1}")
