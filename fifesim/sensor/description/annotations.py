"""Types of arguments for instruments, each with the kind that is checked."""

from collections.abc import Sequence
from typing import Annotated, TypeAlias

from fifesim.base.annotations import FilePath
from fifesim.base.kinds import NAMES, Kind
from fifesim.sensor.description.instrument_file import Instrument

InstrumentLike: TypeAlias = Annotated[
    FilePath | Instrument, Kind("the name of an instrument, such as 'TM', or a fifesim.Instrument")
]
InstrumentsLike: TypeAlias = Annotated[
    Sequence[InstrumentLike], Kind("a list of instruments, such as ['TM', 'OLI']", NAMES.fits)
]
