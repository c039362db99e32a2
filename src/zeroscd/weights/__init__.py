"""Model weights: what exists, where it lies, how it is fetched and read safely."""
