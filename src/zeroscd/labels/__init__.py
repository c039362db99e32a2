"""What a region shows: a class for every pixel of a photo."""
