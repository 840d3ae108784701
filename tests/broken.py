"""Slightly wrong kernels, to test that checks detect errors."""

import numpy as np


def broken(kernel):
    """Return a kernel whose result or output array is 0.1 % too large."""

    def wrong(*arguments, **options):
        found = kernel(*arguments, **options)
        found = np.array(found) if isinstance(found, tuple) else found
        # A returned number is an error code; the results are in the output arrays.
        if not isinstance(found, int | None):
            return found + (found.dtype.type(1) if found.dtype.kind in "iu" else 1e-3 * np.abs(found).max())
        *_, filled = arguments
        for array in filled if isinstance(filled, tuple) else (filled,):
            array += 1e-3 * np.nanmax(np.abs(array))
        return found

    return wrong


def notices(check, monkeypatch, owner, kernel):
    """Whether a check passes, and fails once a kernel of a module is broken."""
    before = all(each.within for each in check())
    monkeypatch.setattr(owner, kernel, broken(getattr(owner, kernel)))
    return before and not all(each.within for each in check())


def exceeded(*checks):
    """Names of the deviations that exceed their bounds."""
    return [deviation.what for check in checks for deviation in check() if not deviation.within]
