"""Export formats: pictures, JSON, COCO, GeoJSON, Parquet, the one-file report."""
