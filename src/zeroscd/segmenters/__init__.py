"""Stage 5a: a photo to outlines of objects and their parts."""
