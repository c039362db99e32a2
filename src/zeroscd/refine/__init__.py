"""Stage 5b: outlines vote, are verified, and become regions."""
