"""Public names of ``fifesim.retrieval``, as in ``fifesim/__init__.pyi``."""

# Retrieval
from .description import read_retrieval as read_retrieval
