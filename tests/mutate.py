"""
Change one operator, comparison, constant or call of the package at a time, and list the changes that no test notices.

    python tests/mutate.py fifesim/output/stac.py                      # 15 changes of a file, a few minutes
    pytest -n auto --cov=fifesim --cov-context=test --cov-report=      # once: which test runs which line
    python tests/mutate.py --draws 300 --log mutations.txt             # the package, hours; goes on where the log ends

The last lines are a summary for a pull request. Without the coverage run, only tests of the module and of modules that
import it are used.

Each change is made in a copy of the checkout. The order of the tests, within limits of processor time, is: tests and
examples of the module; some tests of each other file that run the line; tests of importing modules; tests that run any
line of the module, nearest folders first. A failing test must fail again alone and pass without the change. Floats
change by 1 %, integers by 1. Each test run is a fork of a process that has imported everything except the package.
"""

import argparse
import ast
import contextlib
import copy
import importlib
import multiprocessing
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from functools import cache
from itertools import takewhile
from pathlib import Path

import hypothesis
import pytest

ROOT = Path(__file__).parents[1]
TURNED = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.Mod: ast.Mult,
}
TURNED |= {ast.FloorDiv: ast.Mult, ast.And: ast.Or, ast.Or: ast.And, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd}
TURNED |= {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
SHIFTED = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}


def changes(tree):
    """Every mutation of a module: node, field and new value."""
    for node in _code(tree):
        if isinstance(node, ast.BinOp | ast.AugAssign | ast.BoolOp) and type(node.op) in TURNED:
            yield node, "op", TURNED[type(node.op)]()
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            for table in (TURNED, SHIFTED):
                if type(node.ops[0]) in table:
                    yield node, "ops", [table[type(node.ops[0])]()]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield node, "op", ast.UAdd() if isinstance(node.op, ast.USub) else None
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield node, "value", (node.value * 1.01 or 0.01) if isinstance(node.value, float) else node.value + 1
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield node, "value", ast.Constant(None)


def _code(node):
    """Nodes that compute, i.e. no annotations, decorators, error messages or f-strings."""
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            skipped = name in ("annotation", "returns", "decorator_list") or isinstance(
                child, ast.Raise | ast.JoinedStr
            )
            if isinstance(child, ast.AST) and not skipped:
                yield child
                yield from _code(child)


def changed(source, number):
    """Source with one mutation, its line number, and a description."""
    tree = ast.parse(source)
    node, field, new = list(changes(tree))[number]
    before = ast.unparse(copy.deepcopy(node))
    if new is None:
        node.op, node.operand = ast.Not(), ast.UnaryOp(ast.Not(), node.operand)
    else:
        setattr(node, field, new)
    ast.fix_missing_locations(tree)
    return ast.unparse(tree), node.lineno, f"line {node.lineno}: {before[:90]}  ->  {ast.unparse(node)[:90]}"


def draw(count, seed, only):
    """Random mutations of a folder or module."""
    places, start = [], ROOT / only
    for path in sorted(each.relative_to(ROOT) for each in ([start] if start.is_file() else start.rglob("*.py"))):
        tree = ast.parse((ROOT / path).read_text())
        places += [(path, n) for n, _ in enumerate(changes(tree))]
    return random.Random(seed).sample(places, min(count, len(places)))


def imported(tree):
    """Files of the package that a module may import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("fifesim"):
            for name in (node.module, *(f"{node.module}.{each.name}" for each in node.names)):
                yield Path(*name.split(".")).with_suffix(".py")


# Limits are processor time, so that a loaded machine gives the same result.
LONGEST = 200  # limit of the tests of the module [s]
LONG = 60  # of other tests that run the line [s]
SHORT = 30  # of other tests that run the module [s]
ENDLESS = "it does not end"
FEW = 3  # tests of each other file
TIMED = ("tests/test_faults.py",)  # tests that depend on time


@cache
def importers():
    """Importing modules, by module."""
    direct = {}
    for path in (ROOT / "fifesim").rglob("*.py"):
        for each in imported(ast.parse(path.read_text())):
            direct.setdefault(each, set()).add(path.relative_to(ROOT))
    return direct


@cache
def compiled_with(path):
    """A module and all modules that may have inlined its compiled functions."""
    found, ahead = {path}, [path]
    while ahead:
        for each in importers().get(ahead.pop(), ()):
            words = (ROOT / each).read_text()
            if each not in found and ("compiled" in words or "jitable" in words):
                found.add(each)
                ahead.append(each)
    return found


@cache
def lines_of(path):
    """
    Tests by the lines of a module that they run.

    Lines of compiled functions have no tests, and lines that fill a cache have only the first test.
    """
    if not (ROOT / ".coverage").exists():
        return {}
    from coverage import CoverageData  # not a dependency of the tests

    known = CoverageData(str(ROOT / ".coverage"))
    known.read()
    measured = next((each for each in known.measured_files() if each.endswith(f"/{path}")), None)
    found = known.contexts_by_lineno(measured) if measured else {}
    ran = {line: {each.split("|")[0].split("[")[0] for each in tests if "|" in each} for line, tests in found.items()}
    return {line: set(filter(_exists, tests)) for line, tests in ran.items()}


@cache
def _exists(test):
    """Whether a test still exists; the coverage run may be older than the tests."""
    file, *_, name = test.split("::")
    return (ROOT / file).exists() and (file.startswith("fifesim") or f"def {name}(" in (ROOT / file).read_text())


@cache
def tests_by_module():
    """Test files that import a module, by module."""
    found = {}
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for each in imported(ast.parse(path.read_text())):
            found.setdefault(each, []).append(path.relative_to(ROOT))
    return found


def own_tests(path):
    """The test file of a module, its examples, and the test files that import it."""
    inside = path.relative_to("fifesim")
    own = [Path("tests") / inside.parent / f"test_{inside.name}", path, *tests_by_module().get(path, ())]
    return list(dict.fromkeys(str(each) for each in own if (ROOT / each).exists()))


def _few(tests, path, without):
    """Some tests of each test file, starting with the nearest folders."""
    by_file = {}
    for test in sorted(tests):
        by_file.setdefault(test.split("::")[0], []).append(test)
    files = sorted(by_file, key=lambda file: _apart_by(path, file.replace("fifesim", "tests", 1)))
    return [test for file in files if file not in without for test in by_file[file][:FEW]]


def _apart_by(path, file):
    """Number of folders between a module and a test file."""
    one, other = path.parent.parts[1:], Path(file).parent.parts[1:]
    shared = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False)))
    return len(one) + len(other) - 2 * shared


def tests_of(path, line):
    """Tests that may detect a change of a line, fastest first, and their time limits. [s]"""
    own = own_tests(path)
    yield own, LONGEST
    yield _few(lines_of(path).get(line, ()), path, own), LONG
    neighbours = [test for each in sorted(importers().get(path, ())) for test in own_tests(each)[:1]]
    around = set().union(*lines_of(path).values())
    yield list(dict.fromkeys(neighbours + _few(around, path, own + neighbours))), SHORT


class Watch:
    """Pytest plugin that enforces the time limit, skips timing tests, and records the first failure."""

    def __init__(self, seconds):
        self.end, self.failed = time.process_time() + seconds, None

    def pytest_collection_modifyitems(self, items):
        items[:] = [each for each in items if not each.nodeid.startswith(TIMED)]

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.failed = self.failed or report.nodeid

    pytest_collectreport = pytest_runtest_logreport

    def pytest_runtest_setup(self, item):
        if time.process_time() > self.end:
            item.session.shouldstop = "time is over"
            pytest.skip("time is over")


def failing(tests, seconds=LONGEST):
    """The first test that fails, or None."""
    watch = Watch(seconds)
    options = ["-x", "-q", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=1"]
    # The first example that fails is enough.
    hypothesis.settings.register_profile("first", phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate])
    hypothesis.settings.load_profile("first")
    code = pytest.main([*options, *tests], plugins=[watch])
    return watch.failed or (None if code in (0, 2, 5) else f"exit {code}")


def apart(folder, function, *given):
    """Result of a function in a fork that imports the package from a folder."""
    fork = multiprocessing.get_context("fork")
    here, there = fork.Pipe(duplex=False)
    process = fork.Process(target=_apart, args=(folder, function, given, there))
    process.start()
    there.close()
    try:
        return here.recv() if here.poll(8 * LONGEST) else ENDLESS
    except EOFError:
        return "it dies or does not end"
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.join()


def _apart(folder, function, given, there):
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (2 * LONGEST, 2 * LONGEST))
    os.chdir(folder)
    os.environ |= {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    sys.path[0] = str(folder)
    silent = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(silent, stream)
    try:
        there.send(function(*given))
    except Exception as error:
        there.send(f"{type(error).__name__}: {error}"[:150])
    os._exit(0)


def _imported():
    """Third-party modules that the tests import. The collection of tests also writes bytecode."""
    sys.dont_write_bytecode = False
    pytest.main(["-q", "--collect-only", "-p", "no:cacheprovider"])
    here = os.getcwd()
    return [
        name
        for name, each in list(sys.modules.items())
        if not (getattr(each, "__file__", None) or here).startswith(here)
    ]


class Checkout:
    """Two copies of the checkout, one to change and one unchanged."""

    def __init__(self, scratch):
        self.folder, self.kept = (Path(scratch) / name for name in ("checkout", "kept"))
        shutil.copytree(
            ROOT, self.kept, ignore=shutil.ignore_patterns(".git", ".venv", "gallery", "_build", ".coverage*")
        )
        self.others = apart(self.kept, _imported)
        shutil.copytree(self.kept, self.folder)
        self.passing = {}

    def import_others(self):
        """Import the third-party modules of the forks once, and start the compiler."""
        for name in self.others:
            with contextlib.suppress(Exception):
                importlib.import_module(name)
        importlib.import_module("numba").njit(lambda x: x + 1)(1.0)

    def passes(self, test):
        """Whether a test passes without a change."""
        if test not in self.passing:
            self.passing[test] = apart(self.kept, failing, [test]) is None
        return self.passing[test]

    def noticed(self, path, line):
        """The test that fails with a change, fails again alone, and passes without it; or None."""
        for tests, seconds in tests_of(path, line):
            tests = [each for each in tests if not each.startswith(TIMED)]
            failed = apart(self.folder, failing, tests, seconds) if tests else None
            if failed and "::" in failed:
                again = apart(self.folder, failing, [failed])
                failed = failed if again and self.passes(failed) else None
            if failed:
                return failed
        return None

    def tried(self, path, number):
        """Description of a change, and the test that detected it."""
        text, line, words = changed((self.kept / path).read_text(), number)
        self.restore(path)
        (self.folder / path).write_text(text)
        try:
            return words, self.noticed(path, line)
        finally:
            self.restore(path, caches=True)

    def restore(self, path, caches=False):
        """Restore a module and delete its compiled code; with `caches`, restore the compiled code too."""
        shutil.copy2(self.kept / path, self.folder / path)
        for each in compiled_with(path):
            compiled = f"__pycache__/{each.stem}.*.nb[ic]"
            for one in (self.folder / each.parent).glob(compiled):
                one.unlink()
            for one in (self.kept / each.parent).glob(compiled) if caches else ():
                shutil.copy2(one, self.folder / one.relative_to(self.kept))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("path", nargs="?", default="fifesim", help="folder or module of the package")
    parser.add_argument("--draws", type=int, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--log", type=Path, help="file of results, whose changes are not tried again")
    parser.add_argument("--part", default="1/1", help="such as 2/2: every second, to run two at once")
    given = parser.parse_args()
    part, parts = map(int, given.part.split("/"))
    lines = given.log.read_text().splitlines() if given.log and given.log.exists() else []
    known = "\n".join(lines)
    drawn = draw(given.draws, given.seed, given.path)[part - 1 :: parts]
    # Threads that wait for each other cost more than they bring in products so small.
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory() as scratch:
        checkout = Checkout(scratch)
        checkout.import_others()
        for path, number in drawn:
            if f"{path} {number}:" in known:
                continue
            began = time.monotonic()
            words, found = checkout.tried(path, number)
            lines.append(f"{path} {number}: {words} | {found or 'SURVIVES'} | {time.monotonic() - began:.0f} s")
            print(lines[-1], flush=True)
            if given.log:
                with given.log.open("a") as log:
                    print(lines[-1], file=log)
    survivors = [line for line in lines if "| SURVIVES |" in line]
    print(f"\n{len(lines) - len(survivors)} of {len(lines)} changes of {given.path} are noticed (seed {given.seed})")
    print(*(f"- {line.split(' | ')[0]}" for line in survivors), sep="\n")


if __name__ == "__main__":
    main()
