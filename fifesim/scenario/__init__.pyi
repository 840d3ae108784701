"""Public names of ``fifesim.scenario``, as in ``fifesim/__init__.pyi``."""

# Files and runs
from .chips import chips_of as chips_of
from .scenario import default_scenario as default_scenario
from .scenario import read_scenario as read_scenario
from .studies import read_study as read_study
from .sweeps import sweep as sweep
