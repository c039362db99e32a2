"""The page: two photos in the browser, what changed, and thresholds to move."""
