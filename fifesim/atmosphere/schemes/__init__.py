"""How light goes through the air: 5S, successive orders, 6S."""
