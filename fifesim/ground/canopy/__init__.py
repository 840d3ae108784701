"""Light in leaves and on what lies below them."""
