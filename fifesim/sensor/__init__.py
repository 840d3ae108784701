"""The sensor: images of an instrument from radiance at the top of the atmosphere."""

from fifesim.accessor import namespace_of

__getattr__, __dir__ = namespace_of("sensor")
