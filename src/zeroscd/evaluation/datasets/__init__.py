"""The data sets: where their pairs lie on disk and how their masks are read."""
