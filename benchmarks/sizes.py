"""
Table of the size of the package, the call trace of a function, and the time to compile the kernels of the default run.

Below the table are the names that several modules define.

    python benchmarks/sizes.py
"""

import ast
import inspect
import os
import subprocess
import sys
import tempfile
import tokenize
from collections import defaultdict
from pathlib import Path
from statistics import median

from timing import processor_time

import fifesim

PACKAGE = Path(fifesim.__file__).parent
COMMAND = "from fifesim.cli import app; app()"
NO_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def module_of(path):
    """Dotted name of a file of the package."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[: -1 if parts[-1] == "__init__" else None])


def definitions(tree, prefix=""):
    """Qualified names and nodes of all functions and classes, nested ones too."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, DEFINITIONS):
            yield prefix + node.name, node
            yield from definitions(node, f"{prefix}{node.name}.")
        else:
            yield from definitions(node, prefix)


def docstring_lines(node):
    """Numbers of the lines of the docstring of a module, class or function."""
    if ast.get_docstring(node, clean=False) is None:
        return range(0)
    return range(node.body[0].lineno, node.body[0].end_lineno + 1)


def code_lines(path):
    """Numbers of the lines that hold code, text over several lines included."""
    with tokenize.open(path) as file:
        tokens = [token for token in tokenize.generate_tokens(file.readline) if token.type not in NO_CODE]
    return {line for token in tokens for line in range(token.start[0], token.end[0] + 1)}


def exported():
    """Modules and qualified names of the public functions and classes, including ``fifesim.atmosphere``."""
    found = set()
    for module in (fifesim, fifesim.atmosphere):
        for name in dir(module):
            value = inspect.unwrap(getattr(module, name)) if not name.startswith("_") else None
            if inspect.isfunction(value) or inspect.isclass(value):
                found.add((value.__module__, value.__qualname__))
    return found


def sizes():
    """Rows of files, lines and docstrings, and the modules of each public name that several define."""
    public, code, documented, internal, modules = exported(), [], 0, 0, defaultdict(list)
    files = sorted(PACKAGE.rglob("*.py"))
    for path in files:
        tree, module = ast.parse(path.read_text(encoding="utf-8")), module_of(path)
        nodes = list(definitions(tree))
        docstrings = set(docstring_lines(tree))
        for name, node in nodes:
            docstrings |= (own := set(docstring_lines(node)))
            first, *inner = name.split(".")
            reached = (module, first) in public and not any(part.startswith("_") for part in inner)
            internal += 0 if reached else len(own)
            if not inner and not name.startswith("_"):
                modules[name].append(module)
        documented += len(docstrings)
        code.append(len(code_lines(path) - docstrings))
    repeated = {name: sorted(set(where)) for name, where in modules.items() if len(set(where)) > 1}
    rows = {
        "Python files": len(files),
        "folders": len({path.parent for path in files}),
        "lines of code, median of files that have any": f"{median(filter(None, code)):g}",
        "lines of code without docstrings, comments and blank lines": sum(code),
        "docstring lines": documented,
        "docstring lines of functions and classes that users cannot reach": internal,
        "public functions and classes that several modules define": len(repeated),
    }
    return rows, repeated


def entered(call):
    """Numbers of files and functions of the package that a call enters, and the most of its frames at once."""
    depth, deepest, functions = 0, 0, set()

    def profile(frame, event, argument):
        nonlocal depth, deepest
        code = frame.f_code
        if not code.co_filename.startswith(f"{PACKAGE}{os.sep}"):
            return
        # Count frames, because frames of compiled kernels do not know their caller.
        if event == "call":
            depth += 1
            deepest = max(deepest, depth)
            functions.add((code.co_filename, code.co_qualname))
        elif event == "return":
            depth -= 1

    sys.setprofile(profile)
    try:
        call()
    finally:
        sys.setprofile(None)
    return len({file for file, _ in functions}), len(functions), deepest


def surface_reflectance():
    """Call trace of the second call of ``surface_reflectance``, on 270 x 270 cells in memory."""
    lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 270), (0, 270))), seed=7)

    def call():
        lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])

    call()
    return entered(call)


def compile_time():
    """Processor time by which the default run takes longer without kernels on disk. [s]"""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "kernels")}
        spent = []
        for output in ("first", "second"):
            start = processor_time()
            call = [sys.executable, "-c", COMMAND, "simulate", "-q", "-o", output]
            subprocess.run(call, cwd=folder, env=environment, check=True)
            spent.append(processor_time() - start)
    return spent[0] - spent[1]


def main():
    """Print the table, and the names that several modules define."""
    # First, in a process that has imported no more than the call needs.
    trace = surface_reflectance()
    rows, repeated = sizes()
    rows["files / functions / depth that `surface_reflectance` enters"] = " / ".join(map(str, trace))
    rows["processor time to compile the kernels of the default run [s]"] = f"{compile_time():.1f}"
    print("| | |\n|---|---|")
    print("\n".join(f"| {name} | {value} |" for name, value in rows.items()))
    print()
    for name, modules in sorted(repeated.items()):
        print(f"- `{name}`: {', '.join(modules)}")


if __name__ == "__main__":
    main()
