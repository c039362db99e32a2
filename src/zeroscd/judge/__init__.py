"""Stage 7: which changes to believe, and where nothing can be said."""
