"""One way down: what each file may import, and how files and public functions are made."""

import ast
import inspect
from pathlib import Path

import pytest

import fifesim

PACKAGE = Path(fifesim.__file__).parent
STAGES = ("ground", "atmosphere", "sensor", "analysis")
LABEL_LIBRARIES = {"xarray", "dask", "odc", "rioxarray", "rasterio"}

# The rule of imports: a folder imports from those before it, and from itself. The four stages are one step.
ORDER = ("base", "rasters", "stages", "chain", "scenario", "output", "experiments", "cli")

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


def folder(name):
    return name.split(".")[0]


def step(name):
    """Place of a file's folder in the order."""
    return ORDER.index("stages" if folder(name) in STAGES else folder(name))


def is_physics(name):
    """Files of a stage, but for those that label it: ``raster`` and the files of folders ``rasters``."""
    labels = name.endswith(".raster") or "rasters" in name.split(".")
    return folder(name) in STAGES and not labels


ORDINARY = sorted(set(FILES) - {"__init__", "accessor"})
PHYSICS = [name for name in ORDINARY if is_physics(name) or folder(name) == "base"]


@pytest.mark.parametrize("name", ORDINARY)
def test_imports_lead_down(name):
    assert folder(name) in (*ORDER, *STAGES), f"{name} lies in no folder of {ORDER}"
    for other in own_imports(name):
        allowed = step(other) < step(name) or folder(other) == folder(name)
        assert allowed, f"{name} imports {other}, which is not below it"


@pytest.mark.parametrize("name", PHYSICS)
def test_physics_knows_no_labels_and_no_dask(name):
    assert not libraries(name) & LABEL_LIBRARIES
    assert {folder(other) for other in own_imports(name)} <= {"base", folder(name)}
    assert all(is_physics(other) or folder(other) == "base" for other in own_imports(name))


def circle():
    """Files that import each other in a circle, an empty list where none do."""
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


def test_imports_have_no_circle():
    assert circle() == []


def test_a_folder_is_read_at_a_glance():
    """Whoever opens the package sees Figure 1: the four stages, what lies below them and what is built on them."""
    shown = [path for path in PACKAGE.iterdir() if not path.name.startswith(("__pycache__", "."))]
    assert len([path for path in shown if path.name not in ("data", "py.typed")]) <= 14
    assert {path.name for path in shown if path.is_dir()} - {"data"} == {*ORDER, *STAGES} - {"stages", "cli"}


def code_lines(tree):
    """Statements that are no docstring, import or constant."""
    return [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]


@pytest.mark.parametrize(
    "name", [name for name in ORDINARY if code_lines(TREES[name]) and not name.endswith("__init__")]
)
def test_every_module_has_tests_of_its_name(name):
    """Tests mirror the tree, so that a maintainer finds them."""
    *folders, last = name.split(".")
    assert Path(__file__).parent.joinpath(*folders, f"test_{last}.py").exists()


def test_only_the_package_imports_the_accessor():
    assert [name for name in FILES if "accessor" in own_imports(name)] == ["__init__"]


@pytest.mark.parametrize("name", sorted(set(FILES) - {"cli"}))
def test_imports_stand_at_the_top(name):
    """The command line imports late, so that its help is instant; others only what is slow and what few runs need."""
    functions = [node for node in ast.walk(TREES[name]) if isinstance(node, ast.FunctionDef)]
    assert {library.split(".")[0] for each in functions for library in imported(each)} <= {"distributed", "zarr"}


def test_only_the_front_doors_import_by_name():
    """`import_module` would pass by the other tests."""
    by_name = {name for name in FILES if "importlib.import_module" in imported(TREES[name])}
    assert by_name <= {"__init__", "accessor", "atmosphere.__init__"}


@pytest.mark.parametrize("name", FILES)
def test_no_file_shares_a_name_with_a_public_function_in_it(name):
    functions = {node.name for node in TREES[name].body if isinstance(node, ast.FunctionDef)}
    assert name.split(".")[-1] not in functions


def lines_of_code(name):
    """Number of lines of a file that are not blank, comments or docstrings."""
    docstrings = set()
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            docstrings |= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    lines = FILES[name].read_text(encoding="utf-8").splitlines()
    return sum(
        number not in docstrings and bool(line.strip()) and not line.lstrip().startswith("#")
        for number, line in enumerate(lines, 1)
    )


def test_no_file_has_more_than_400_lines_of_code():
    """A longer file covers more than one topic; docstrings do not count."""
    assert {name: lines_of_code(name) for name in FILES if lines_of_code(name) > 400} == {}


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


def test_functions_have_their_docstrings():
    """A public function has all sections; an internal one has them too, or one sentence."""
    lacking = []
    for parameter in public_functions():
        (function,), name = parameter.values, parameter.id
        text = inspect.cleandoc(ast.get_docstring(function) or "")
        public = name.rsplit(".", 1)[-1] in fifesim.__all__ or name.rsplit(".", 2)[-2] in fifesim.__all__
        if text and "\n\n" not in text and not public:
            continue
        missing = [each for each in sections_needed(function) if f"\n{each}\n{'-' * len(each)}\n" not in text]
        lacking += [f"{name}: {', '.join(missing) or 'no docstring'}"] if missing or not text else []
    assert lacking == []


def test_public_names_are_documented_and_importable():
    for name in fifesim.__all__:
        found = getattr(fifesim, name)
        assert name == "__version__" or found.__doc__
