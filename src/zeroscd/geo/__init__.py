"""Georeferenced pairs of any size: GeoTIFFs in, a mask and polygons on the map out."""
