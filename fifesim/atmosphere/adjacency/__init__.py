"""What the ground around a cell adds to what is seen of it."""
