"""Stage 6: segments vote, are verified, and become regions."""
