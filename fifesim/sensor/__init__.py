"""The sensor: images of an instrument from radiance at the top of the atmosphere."""
