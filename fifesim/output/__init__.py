"""Output: figures, pages and folders."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("output")
