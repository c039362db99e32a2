"""What a setting is worth: many settings on one data set, each pair encoded once."""
