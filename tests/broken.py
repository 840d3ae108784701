"""Production kernels that are a little wrong, to see that checks look at them."""

import numpy as np


def broken(kernel):
    """The kernel with a thousandth more in what it returns or fills."""

    def wrong(*arguments, **options):
        found = kernel(*arguments, **options)
        found = np.array(found) if isinstance(found, tuple) else found
        # Numbers say what is wrong with the arguments; what is made then is filled in.
        if not isinstance(found, int | None):
            return found + (found.dtype.type(1) if found.dtype.kind in "iu" else 1e-3 * np.abs(found).max())
        *_, filled = arguments
        for array in filled if isinstance(filled, tuple) else (filled,):
            array += 1e-3 * np.nanmax(np.abs(array))
        return found

    return wrong


def notices(check, monkeypatch, owner, kernel):
    """Whether all is well, and a check exceeds a bound once a kernel of a module is broken."""
    before = all(each.within for each in check())
    monkeypatch.setattr(owner, kernel, broken(getattr(owner, kernel)))
    return before and not all(each.within for each in check())


def exceeded(*checks):
    """What lies beyond its bound."""
    return [deviation.what for check in checks for deviation in check() if not deviation.within]
