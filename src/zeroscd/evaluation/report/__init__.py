"""The scores shown: tables, curves, pictures, and one page that works offline."""
