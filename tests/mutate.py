"""
Turn one operator, comparison, constant or call of the package at a time, and list what no test notices.

    pytest -n auto --cov=fifesim --cov-context=test --cov-report=      # once: which test runs which line
    python tests/mutate.py 300 --seed 1 --log mutations.txt            # hours; goes on where the log ends
    python tests/mutate.py 20 --only fifesim/ground                    # part of the package
    python tests/mutate.py 40 --only fifesim/atmosphere --verify       # what `fifesim verify` alone notices

Each change is made in a copy of the checkout. The module's own tests come first, then those of other files that run
the line, then all that run any line of the module or of one that imports it, until one fails. Numbers with a point
change by a hundredth, whole numbers by one.
"""

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

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
LONGEST = 1200  # of one run of tests [s]
FEW = 3  # tests of each other file that runs a line


def changes(tree):
    """Every change of a module: node, field, what takes its place."""
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
            yield node, "value", node.value * 1.01 if isinstance(node.value, float) else node.value + 1
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield node, "value", ast.Constant(None)


def _code(node):
    """Nodes that compute: no annotations, decorators, messages or texts."""
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            skipped = name in ("annotation", "returns", "decorator_list") or isinstance(
                child, ast.Raise | ast.JoinedStr
            )
            if isinstance(child, ast.AST) and not skipped:
                yield child
                yield from _code(child)


def changed(source, number):
    """Source with one change, its line, and the change in words."""
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
    """Places of changes, drawn from all with equal weight."""
    files = sorted(each.relative_to(ROOT) for each in (ROOT / only).rglob("*.py"))
    places = [(each, n) for each in files for n, _ in enumerate(changes(ast.parse((ROOT / each).read_text())))]
    return random.Random(seed).sample(places, min(count, len(places)))


@cache
def importers():
    """By module, those that import it, through others too."""
    direct = {}
    for path in (ROOT / "fifesim").rglob("*.py"):
        one = path.relative_to(ROOT)
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("fifesim"):
                found = [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
                for name in found:
                    direct.setdefault(Path(*name.split(".")).with_suffix(".py"), set()).add(one)
    return direct


def compiled_with(path):
    """A module and all that may have compiled its functions into theirs."""
    found, ahead = {path}, [path]
    while ahead:
        for each in importers().get(ahead.pop(), ()):
            if each not in found and "numba" in (ROOT / each).read_text():
                found.add(each)
                ahead.append(each)
    return found


@cache
def lines_of(path):
    """
    Tests by the lines of a module that they run.

    Compiled lines have none, and those that fill a cache have the first test alone.
    """
    from coverage import CoverageData  # which tests themselves do not need

    known = CoverageData(str(ROOT / ".coverage"))
    known.read()
    found = known.contexts_by_lineno(str(ROOT / path))
    return {line: {each.rsplit("|", 1)[0] for each in tests if "|" in each} for line, tests in found.items()}


def tests_of(path, line):
    """What may notice a change of a line, the quickest first."""
    inside = path.relative_to("fifesim")
    own = [Path("tests") / inside.parent / f"test_{inside.name}", path]
    own = [str(each) for each in own if (ROOT / each).exists()]
    yield own
    elsewhere = {}
    for test in sorted(lines_of(path).get(line, ())):
        elsewhere.setdefault(test.split("::")[0], []).append(test)
    yield [test for file, tests in elsewhere.items() if file not in own for test in tests[:FEW]]
    seen = {test for each in (path, *importers().get(path, ())) for tests in lines_of(each).values() for test in tests}
    yield sorted(seen)


def noticed(folder, tests):
    """The first test that fails, or None."""
    listed = folder / "tests.txt"
    listed.write_text("\n".join(tests))
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider", f"@{listed}"]
    environment = os.environ | {"PYTHONPATH": str(folder)}
    try:
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return "it does not end"
    if run.returncode in (0, 5):
        return None
    failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0][:150] if failed else f"exit {run.returncode}"


def verified(folder):
    """Whether the checks of an installation pass."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    run = subprocess.run(
        [sys.executable, "-m", "fifesim.cli", "verify"], cwd=folder, env=environment, capture_output=True, text=True
    )
    return None if run.returncode == 0 else "fifesim verify"


def tried(folder, path, number, verify):
    """A change in words, and what noticed it."""
    source = (ROOT / path).read_text()
    text, line, words = changed(source, number)
    (folder / path).write_text(text)
    for each in compiled_with(path):
        for kept in (folder / each.parent / "__pycache__").glob(f"{each.stem}.*.nb[ic]"):
            kept.unlink()
    try:
        if verify:
            return words, verified(folder)
        return words, next(filter(None, (noticed(folder, tests) for tests in tests_of(path, line) if tests)), None)
    finally:
        (folder / path).write_text(source)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("draws", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="fifesim", help="folder of the package")
    parser.add_argument("--verify", action="store_true", help="ask `fifesim verify` instead of the tests")
    parser.add_argument("--log", type=Path, default=Path("mutations.txt"))
    parser.add_argument("--part", default="1/1", help="such as 2/2: every second, to run two at once")
    given = parser.parse_args()
    known = given.log.read_text() if given.log.exists() else ""
    part, parts = map(int, given.part.split("/"))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "checkout"
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(".git", ".venv", "gallery", "_build"))
        for path, number in draw(given.draws, given.seed, given.only)[part - 1 :: parts]:
            name = f"{path} {number}:"
            if name not in known:
                words, found = tried(folder, path, number, given.verify)
                with given.log.open("a") as log:
                    print(name, words, "|", found or "SURVIVES", file=log)


if __name__ == "__main__":
    main()
