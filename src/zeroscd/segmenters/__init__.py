"""Stage 5a: a photo to segments, which are objects and their parts."""
