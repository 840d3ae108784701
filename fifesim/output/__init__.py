"""What people get: figures, pages and folders."""
