"""Mutations of one operator, comparison, constant or call of the package, and their random selection."""

import ast
import copy
import random
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
CHECKS = "fifesim/experiments/verification.py"  # what `fifesim verify` runs
STAGES = ("base", "ground", "atmosphere", "sensor", "analysis")  # whose kernels it names


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


def draw(count, seed, only, verify=False):
    """Random mutations of all code, or only of kernels that `fifesim verify` calls."""
    places, start = [], ROOT / only
    for path in sorted(each.relative_to(ROOT) for each in ([start] if start.is_file() else start.rglob("*.py"))):
        tree = ast.parse((ROOT / path).read_text())
        lines = _named_lines(path, tree) if verify else None
        places += [(path, n) for n, (node, *_) in enumerate(changes(tree)) if not verify or node.lineno in lines]
    return random.Random(seed).sample(places, min(count, len(places)))


def imported(tree):
    """Files of the package that a module may import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("fifesim"):
            for name in (node.module, *(f"{node.module}.{each.name}" for each in node.names)):
                yield Path(*name.split(".")).with_suffix(".py")


@cache
def _named():
    """Files that the comparisons import, and all names that they use."""
    tree = ast.parse((ROOT / CHECKS).read_text())
    return set(imported(tree)), _names(tree)


def _names(node):
    return {getattr(each, "id", getattr(each, "attr", None)) for each in ast.walk(node)}


def _named_lines(path, tree):
    """Lines of functions of a file that the comparisons name, and of functions of the file called by them."""
    files, names = _named()
    if path not in files or path.parts[1] not in STAGES or {"raster.py", "rasters"} & set(path.parts):
        return set()
    known = {each.name: each for each in tree.body if isinstance(each, ast.FunctionDef | ast.ClassDef)}
    found, ahead = set(), set(known) & names
    while ahead:
        found |= ahead
        ahead = (set(known) & set().union(*(_names(known[each]) for each in ahead))) - found
    return {line for each in found for line in range(known[each].lineno, known[each].end_lineno + 1)}
