"""Many pairs at once, on this machine or on a cluster; a killed run continues where it was.

from zeroscd import batch

summary = batch.run("pairs.csv", "changes")
"""

from zeroscd.batch.comparer import Options
from zeroscd.batch.job import Summary, run
from zeroscd.batch.local import Local
from zeroscd.batch.manifest import Manifest, open_folders, open_manifest

__all__ = ["Local", "Manifest", "Options", "Summary", "open_folders", "open_manifest", "run"]
