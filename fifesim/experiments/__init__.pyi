"""Public names of ``fifesim.experiments``, as in ``fifesim/__init__.pyi``."""

# Files and runs
from .explorer import explore as explore
from .scatter.shares import scenario_like as scenario_like
from .scatter.study_indices import sensitivity as sensitivity
from .verification import verify as verify
