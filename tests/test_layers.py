"""One way down: what each file may import, and how files and public functions are made."""

import ast
import inspect
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import fifesim

PACKAGE = Path(fifesim.__file__).parent
STAGES = ("ground", "atmosphere", "sensor", "analysis")
LABEL_LIBRARIES = {"xarray", "dask", "odc", "rioxarray", "rasterio"}

# From the bottom up: a file imports only files of lower tiers. Physics of one stage may import each other, and so may
# its files on labelled rasters, whose names end in "raster".
TIERS = (
    {
        "blocks",
        "datasets",
        "experiments.__init__",
        "folders",
        "footprints",
        "geometry",
        "lattice",
        "progress",
        "sites",
    },
    {"bands"},
    {"cf", "grid", "saved", "schedule", "workers"},
    {"chunks"},
    {"warp"},
    {"physics"},
    {"raster"},
    {"verification.__init__", "verification.deviations", "verification.listing"},
    {f"verification.{area}" for area in ("atmosphere", "canopy", "landscape", "sensor", "terrain")},
    {"verification.areas"},
    {"scenario_section"},
    {"scenario_ground", "scenario_sensor"},
    {"export", "scenario"},
    {"chain", "scenario_file"},
    {"comparison", "products", "simulation"},
    {"sweeps"},
    {"figures"},
    {"report"},
    {"estimates", "run"},
    {"experiments.friedl1995", "experiments.stages"},
    {"experiments.friedl1995_table", "experiments.scatter"},
    {"experiments.friedl1995_effects", "experiments.friedl1995_figures"},
    {"experiments.friedl1995_report", "experiments.scatter_report"},
    {"experiments.reproduction", "experiments.scatter_run"},
    {"cli"},
)
# What knows neither labels nor dask, beside the physics.
PLAIN = {"bands", "datasets", "footprints", "geometry", "lattice"}
FILES = {path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", "."): path for path in PACKAGE.rglob("*.py")}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in FILES.items()}


def imported(tree):
    """Dotted names that a file imports, wherever in it."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def own_imports(name):
    """Files of the package that a file imports."""
    found = set()
    for dotted in imported(TREES[name]):
        parts = dotted.split(".")
        if parts[0] == "fifesim":
            path = ".".join(parts[1:])
            found.add(path if path in FILES else path.rpartition(".")[0])
    return found - {""}


def libraries(name):
    return {dotted.split(".")[0] for dotted in imported(TREES[name])}


def stage(name):
    first = name.split(".")[0]
    return first if first in STAGES else None


def is_physics(name):
    return stage(name) is not None and not name.endswith("raster")


def tier(name):
    if stage(name):
        name = "physics" if is_physics(name) else "raster"
    found = [number for number, names in enumerate(TIERS) if name in names]
    assert found, f"{name} has no tier in {Path(__file__).name}: say what it may import"
    return found[0]


ORDINARY = sorted(set(FILES) - {"__init__", "accessor"})


@pytest.mark.parametrize("name", ORDINARY)
def test_imports_lead_down(name):
    assert tier(name) >= 0
    for other in own_imports(name):
        same_layer = stage(name) is not None and stage(name) == stage(other) and tier(name) == tier(other)
        assert tier(other) < tier(name) or same_layer, f"{name} imports {other}, which is not below it"


@pytest.mark.parametrize("name", [name for name in ORDINARY if stage(name)])
def test_stages_never_import_each_other(name):
    others = {stage(other) for other in own_imports(name)} - {None, stage(name)}
    assert not others, f"{name} imports the stage {others}: what it needs of it is an argument"


@pytest.mark.parametrize("name", [name for name in ORDINARY if is_physics(name) or name in PLAIN])
def test_physics_knows_no_labels_and_no_dask(name):
    assert not libraries(name) & LABEL_LIBRARIES
    assert not own_imports(name) & {"cf", "chunks", "grid", "warp"}


def test_imports_have_no_circle():
    list(TopologicalSorter({name: own_imports(name) for name in FILES}).static_order())


def test_only_the_package_imports_the_accessor():
    assert [name for name in FILES if "accessor" in own_imports(name)] == ["__init__"]


@pytest.mark.parametrize("name", sorted(set(FILES) - {"cli"}))
def test_imports_stand_at_the_top(name):
    """Only the command line imports late, so that its help is instant."""
    inside = [node for each in ast.walk(TREES[name]) if isinstance(each, ast.FunctionDef) for node in ast.walk(each)]
    assert not any(isinstance(node, ast.Import | ast.ImportFrom) for node in inside)


def test_only_the_front_doors_import_by_name():
    """`import_module` would pass by the other tests."""
    by_name = {name for name in FILES if "importlib.import_module" in imported(TREES[name])}
    assert by_name <= {"__init__", "accessor", "atmosphere.__init__", "cli"}


@pytest.mark.parametrize("name", FILES)
def test_no_file_shares_a_name_with_a_public_function_in_it(name):
    functions = {node.name for node in TREES[name].body if isinstance(node, ast.FunctionDef)}
    assert name.split(".")[-1] not in functions


@pytest.mark.parametrize("name", FILES)
def test_files_are_shorter_than_400_lines(name):
    assert len(FILES[name].read_text(encoding="utf-8").splitlines()) < 400


def public_functions():
    """Functions of modules and methods of classes, by a readable name; the command line's speak to a terminal."""
    for name, tree in TREES.items():
        if name == "cli":
            continue
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                yield pytest.param(node, id=f"{name}.{node.name}")
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                for method in node.body:
                    if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                        yield pytest.param(method, id=f"{name}.{node.name}.{method.name}")


def own_nodes(function):
    """Nodes of a function without those of functions inside it."""
    for child in ast.iter_child_nodes(function):
        if not isinstance(child, ast.FunctionDef | ast.Lambda):
            yield child
            yield from own_nodes(child)


def sections_needed(function):
    """
    Sections that its docstring must have.

    A method that takes nothing, such as a property, says what it gives in one line.
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


@pytest.mark.parametrize("function", list(public_functions()))
def test_public_function_has_its_docstring(function):
    text = inspect.cleandoc(ast.get_docstring(function) or "")
    assert text, "no docstring"
    for section in sections_needed(function):
        assert f"\n{section}\n{'-' * len(section)}\n" in text, f"the docstring has no section {section}"


def test_public_names_are_documented_and_importable():
    for name in fifesim.__all__:
        found = getattr(fifesim, name)
        assert name == "__version__" or found.__doc__
