"""What is in the air: profiles, molecules, aerosol and gases."""

ENGINES = ("5S", "successive-orders", "successive-orders-scalar", "6S")
"""Schemes of radiative transfer by name, in the order of messages. Importing the list loads no physics."""
