"""Where the pairs of the published data sets lie on disk, and how their masks are read."""
