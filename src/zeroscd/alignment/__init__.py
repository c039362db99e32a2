"""Stage 3: correspondences to a homography, and carrying things with it."""
