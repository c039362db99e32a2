"""What a setting is worth: many settings on one data set, features and segments computed once."""
