"""What a reader sees of a docstring: names to type, links that lead somewhere, units and equations that fit."""

import re
from importlib import import_module

from fifesim.accessor import PUBLIC, find

_PATH = re.compile(r"\bfifesim(?:\.\w+)*\.(\w+)\.(\w+)\b")
_MODULE = re.compile(r"(?<![`.\w])`?\b(\w+)\.([A-Z]\w+)\b(?=`?)")
_BRACKET = re.compile(r"\[[^\]\[`\"']*\]")
_UNIT = re.compile(r"\b(m|km|cm|um|sr|g|kg|ug|K|pixel)(-?[1-4])\b")
_RAISED = str.maketrans("-1234", "⁻¹²³⁴")
_SEPARATOR = re.compile(r"([,;])\s*(\\q?quad)\s+")
_WIDEST = 26


def readable(lines):
    """
    Lines of a docstring as the reference shows them.

    Parameters
    ----------
    lines : list of str

    Returns
    -------
    lines : list of str
    """
    shown = [line if _is_code(line) else _linked(raised(line)) for line in lines]
    return _equations(shown)


def _is_code(line):
    return line.lstrip().startswith((">>>", "..."))


def _linked(line):
    line = _PATH.sub(_public, line)
    return _MODULE.sub(_of_module, line)


def _public(found):
    """`fifesim.scenario.scenario.Scenario` is `fifesim.Scenario` to those who type it."""
    path, name = found[0].rpartition(".")[0], found[2]
    if name not in PUBLIC:
        return found[0]
    try:
        inner = getattr(import_module(path), name, None)
    except ImportError:
        return found[0]
    outer = find(name)
    same = inner is outer or inner is getattr(outer, "__wrapped__", None)
    return PUBLIC[name].path if same else found[0]


def _of_module(found):
    """A class of the package by its module's last name, `models.Atmosphere`."""
    if found[0].startswith("`") or found[2] not in PUBLIC:
        return found[0]
    return PUBLIC[found[2]].path


def raised(line):
    """Units with their exponents raised, which no line breaks: m-2 is m⁻²."""
    return _BRACKET.sub(_raised_units, line)


def _raised_units(found):
    changed = _UNIT.sub(lambda unit: unit[1] + unit[2].translate(_RAISED), found[0])
    return found[0] if changed == found[0] else changed.replace(" ", "\N{NO-BREAK SPACE}")


def _equations(lines):
    """Equations of several parts, side by side where they are short, else below each other."""
    shown, number = [], 0
    while number < len(lines):
        line = lines[number]
        shown.append(line)
        number += 1
        if not line.lstrip().startswith(".. math::"):
            continue
        indent = len(line) - len(line.lstrip())
        body = []
        while number < len(lines) and (
            not lines[number].strip() or lines[number].startswith(" " * (indent + 1))
        ):
            body.append(lines[number])
            number += 1
        formula = " ".join([line.partition("math::")[2], *body]).strip()
        if parts := _stacked(formula):
            margin = " " * (indent + 4)
            shown[-1:] = [" " * indent + ".. math::", "", margin + r"\begin{gathered}"]
            shown += [margin + part for part in parts] + [margin + r"\end{gathered}", ""]
        else:
            shown += body
    return shown


def _stacked(formula):
    """Lines of an equation that is too wide for a phone, or None."""
    if "&" in formula or r"\\" in formula or _width(formula) <= _WIDEST:
        return None
    first, *rest = _SEPARATOR.split(formula)
    lines = [first]
    for mark, space, part in zip(rest[::3], rest[1::3], rest[2::3], strict=True):
        together = f"{lines[-1]}{mark} {space} {part}"
        if _width(together) <= _WIDEST:
            lines[-1] = together
        else:
            lines[-1] += mark + r" \\"
            lines.append(part)
    return lines if len(lines) > 1 else None


def _width(formula):
    """About how many letters wide a formula is."""
    formula = re.sub(
        r"\\(left|right|mathrm|mathbf|text|[dt]?frac|,|quad|limits|operatorname)", "", formula
    )
    return len(re.findall(r"\\[a-zA-Z]+|[^\s{}^_\\]", formula))
