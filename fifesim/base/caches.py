"""Caches of intermediate results, with their contents and sizes, and a function that clears all of them."""

from functools import lru_cache, wraps
from types import SimpleNamespace
from typing import Any, NamedTuple


class Cache(NamedTuple):
    """Contents of a cache, its maximum number of results (None for no limit), and its function."""

    what: str
    size: int | None
    function: Any


CACHES: list[Cache] = []
"""Caches of the modules that are imported."""


def cached(size, what, key=None):
    """Decorator of a function that keeps its latest results, by its arguments or by a key that they have."""

    def decorate(function):
        if key is not None:
            return _by_key(function, Results(size, what), key)
        kept = lru_cache(maxsize=size)(function)
        CACHES.append(Cache(what, size, kept))
        return kept

    return decorate


def _by_key(function, kept, key):
    @wraps(function)
    def found(*args):
        at = key(*args)
        result = kept.get(at)
        if result is None:
            result = kept[at] = function(*args)
        return result

    return found


class Results(dict):
    """Cache that a function fills itself, because threads wait for each other's results; the latest are kept."""

    def __init__(self, size, what):
        super().__init__()
        self._size, self.cache_clear = size, self.clear
        CACHES.append(Cache(what, size, self))

    def __setitem__(self, key, result):
        super().__setitem__(key, result)
        for old in list(self)[: -self._size]:
            self.pop(old, None)

    def cache_info(self):
        """Number of results, as `functools.lru_cache` states it."""
        return SimpleNamespace(currsize=len(self))


def clear_caches() -> None:
    """
    Free the memory of intermediate results that fifesim keeps between calls.

    These are tables of reflectance, terms of the atmosphere, tiles of random fields and of hills, warped tiles of files
    and parsed data files. Each kind has a bound, so a long process does not grow; results do not depend on them. Clear
    them to measure times, or to make room for something else in the same process.

    Notes
    -----
    Worker processes have separate caches: ``client.run(fifesim.clear_caches)``.

    Examples
    --------
    >>> import fifesim
    >>> air = fifesim.Atmosphere()
    >>> fifesim.clear_caches()
    """
    for cache in CACHES:
        cache.function.cache_clear()
