"""What leaves the house: pictures, JSON, COCO, the one-file report."""
