"""Output: figures, pages and folders."""
