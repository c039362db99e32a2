"""Stage 1: any source to an RGB array, its working size, and the patch grid laid over it."""
