"""Stage 2: a photo to unit-length patch descriptors."""
