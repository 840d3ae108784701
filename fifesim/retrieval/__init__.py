"""Retrieval of LAI and FPAR from images, with intervals and flags."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("retrieval")
