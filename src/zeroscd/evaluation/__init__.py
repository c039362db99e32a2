"""Data sets, metrics, published numbers and reports."""
