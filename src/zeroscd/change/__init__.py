"""Stage 4: aligned descriptors to a coarse change map."""
