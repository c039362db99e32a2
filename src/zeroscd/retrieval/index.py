"""The place index: add old photos; find those that show the place of a new one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from zeroscd.errors import DatasetError
from zeroscd.images.exif import Exif, read_exif
from zeroscd.images.folder import absolute
from zeroscd.images.read import read_file, read_photo
from zeroscd.models import load_encoder
from zeroscd.progress import Silent
from zeroscd.retrieval.build import Builder
from zeroscd.retrieval.candidates import Candidates
from zeroscd.retrieval.compatibility import (
    about,
    check_compatibility,
    describe_reference,
    settings_from,
)
from zeroscd.retrieval.database import is_index
from zeroscd.retrieval.describe import describe
from zeroscd.retrieval.gps import metres
from zeroscd.retrieval.rerank import geometric_score
from zeroscd.retrieval.store import Store
from zeroscd.settings import Settings
from zeroscd.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from zeroscd.encoders.port import PatchEncoder
    from zeroscd.images.read import PhotoSource
    from zeroscd.progress import Progress
    from zeroscd.retrieval.build import Added
    from zeroscd.retrieval.candidates import DateSpan
    from zeroscd.retrieval.describe import Place
    from zeroscd.retrieval.gps import Nearby
    from zeroscd.retrieval.rerank import Corners
    from zeroscd.retrieval.rows import Entry

CANDIDATES = 30  # re-ranked by their patches (docs/places.md)
# Score from which two photos count as of one place: wrong streets stay below (docs/places.md).
RECOGNISED = 0.012
DEFAULT = Settings(side_px=416)  # places need fewer pixels than changes


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceMatch:
    """An old photo that may show the place.

    Attributes:
        path: Of its file.
        score: 0..1, share of distinctive patches that match under a homography, over all scales.
        inliers: Number of these patches.
        similarity: Cosine of the global descriptors, by which candidates are chosen.
        metres: Distance between where both were taken; None if either has no position.
        exif: Position, time and heading of the old photo.
        corners: Where the corners of the new photo lie in the old one, (x, y) as shares of its
            width and height, from the top left one clockwise; None if no homography was found.
    """

    path: str
    score: float
    inliers: int
    similarity: float
    metres: float | None
    exif: Exif
    corners: Corners | None = None


class PlaceIndex:
    """An index of old photos by the places that they show.

    Args:
        store: Holds the entries.
        encoder: The encoder that the index was made with.
        settings: The settings that the index was made with.
    """

    def __init__(self, store: Store, encoder: PatchEncoder, settings: Settings) -> None:
        self._store = store
        self._encoder = encoder
        self.settings = settings

    @classmethod
    def create(
        cls,
        address: str | Path,
        *,
        settings: Settings | None = None,
        encoder: PatchEncoder | None = None,
        device: str = "auto",
    ) -> Self:
        """Make an empty index.

        Args:
            address: A folder, or an address of an object store such as "s3://bucket/places".
            settings: Choose the encoder and its input size; `DEFAULT` if not given.
            encoder: Used instead of loading the one that `settings` names.
            device: "auto", "cpu", "cuda" or "mps".

        Raises:
            DatasetError: There is an index already.
            OutputError: It cannot be written.
            SettingsError: LanceDB is not installed, or an unknown encoder or device.
            WeightsError: The encoder's weights are missing or damaged.
        """
        name = str(address)
        if is_index(name):
            message = f"{one_line(name)} is a place index already; open it to add photos"
            raise DatasetError(message)
        chosen = settings or DEFAULT
        loaded = encoder or load_encoder(chosen, device=device)
        return cls(Store.create(name, about(chosen), describe_reference(loaded)), loaded, chosen)

    @classmethod
    def open(
        cls,
        address: str | Path,
        *,
        settings: Settings | None = None,
        encoder: PatchEncoder | None = None,
        device: str = "auto",
    ) -> Self:
        """Open an index with the encoder that it was made with.

        Args:
            address: A folder, or an address of an object store.
            settings: Refused if the index was made with others; None = the index's own.
            encoder: Used instead of loading the one that the index was made with.
            device: "auto", "cpu", "cuda" or "mps".

        Raises:
            DatasetError: There is no index.
            SettingsError: The index was made with another encoder, settings or incompatible
                version; or LanceDB is not installed.
            WeightsError: The encoder's weights are missing or damaged.
        """
        store = Store.open(str(address))
        chosen = settings_from(store.about, wanted=settings)
        loaded = encoder or load_encoder(chosen, device=device)
        check_compatibility(store.reference, describe_reference(loaded), store.about)
        return cls(store, loaded, chosen)

    def __len__(self) -> int:
        return len(self._store)

    def add(self, paths: Sequence[str | Path], *, progress: Progress | None = None) -> Added:
        """Add photos that are new or have changed; a killed run loses few (`build.BATCH`).

        The bytes of a photo are stored once: copies are not added, and photos that have moved keep
        their descriptors. Entries that are there twice are removed.

        Args:
            paths: Of files; made absolute.
            progress: Told of every photo.

        Raises:
            OutputError: The index cannot be written.
        """
        builder = Builder(self._store, self._describe_file)
        listener = progress or Silent()
        unique = dict.fromkeys(absolute(path) for path in paths)
        listener.begin(len(unique))
        for path in sorted(unique, key=lambda path: not builder.knows(path)):
            described = builder.add(path)
            listener.advance(Path(path).name, reused=not described)
        builder.write()
        added = builder.added
        if added.new or added.changed or added.moved:
            self._store.tidy()
        return added

    def remove(self, paths: Iterable[str | Path]) -> int:
        """Remove photos, or all photos below folders; return how many were removed.

        Raises:
            OutputError: The index cannot be written.
        """
        return self._store.remove_below(paths)

    def describe(self, photo: PhotoSource, *, exif: Exif | None = None) -> Place:
        """Describe the place that a photo shows; `exif` replaces that of its file.

        Raises:
            ImageError: It cannot be read.
        """
        if isinstance(photo, str | Path):
            return self._describe_file(read_file(photo), str(photo), exif=exif)
        if isinstance(photo, bytes):
            return self._describe_file(photo, exif=exif)
        return describe(read_photo(photo), self._encoder, exif=exif)

    def find(
        self,
        place: Place,
        count: int = 5,
        *,
        nearby: Nearby | None = None,
        dates: DateSpan | None = None,
        rerank: bool = True,
    ) -> list[PlaceMatch]:
        """Find the old photos that show a place, best first.

        The photos with the most similar global descriptors are re-ranked by their patches. Photos
        that look another way, by more than `candidates.MAX_TURN_DEG`, are left out.

        Args:
            place: As `describe` returns it.
            count: How many photos at most.
            nearby: Search only this circle; photos without a position are left out.
            dates: Search only photos of these days; those without a time are left out.
            rerank: If False, the order is that of the global descriptors, and scores are zero.
        """
        limit = max(count, CANDIDATES) if rerank else count
        among = Candidates(nearby=nearby, dates=dates, heading_deg=place.exif.heading_deg)
        nearest = self._store.nearest(place.vector, limit, among=among)
        matches = [_match(place, entry, cosine, rerank=rerank) for entry, cosine in nearest]
        # Sorting is stable: among equal scores the more similar global descriptor stays first.
        return sorted(matches, key=lambda match: -match.score)[:count]

    def query(
        self, photo: PhotoSource, count: int = 5, *, nearby: Nearby | None = None
    ) -> list[PlaceMatch]:
        """Find the old photos that show the place of a new one, best first.

        Raises:
            ImageError: The new photo cannot be read.
        """
        return self.find(self.describe(photo), count, nearby=nearby)

    def undated(self) -> int:
        """Return how many photos do not say when they were taken."""
        return self._store.undated()

    def state(self) -> str:
        """Return a digest that changes whenever the photos in the index do."""
        return self._store.state()

    def info(self) -> dict[str, Any]:
        """Return a description of the index, as plain values."""
        return self._store.info()

    def _describe_file(
        self, content: bytes, name: str | None = None, *, exif: Exif | None = None
    ) -> Place:
        photo = read_photo(content, name=name)
        return describe(photo, self._encoder, exif=exif or read_exif(content))


def _match(place: Place, entry: Entry, cosine: float, *, rerank: bool) -> PlaceMatch:
    old = entry.place
    geometric = (
        geometric_score(place.patches, old.patches, sizes_hw=(place.size_hw, old.size_hw))
        if rerank
        else None
    )
    gps, old_gps = place.exif.gps, old.exif.gps
    return PlaceMatch(
        path=entry.path,
        score=geometric.score if geometric else 0.0,
        inliers=geometric.inliers if geometric else 0,
        similarity=cosine,
        metres=metres(gps, old_gps) if gps and old_gps else None,
        exif=old.exif,
        corners=geometric.corners if geometric else None,
    )
