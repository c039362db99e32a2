"""How much a server accepts, how long it waits, and how much it keeps."""

from __future__ import annotations

from dataclasses import dataclass

from zeroscd.images.read import PhotoLimits

MEGA = 1_000_000
FORM_BYTES = 1 * MEGA  # room for the other fields of a form


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Every bound of the server; a request beyond one gets a 4xx answer that names it.

    Attributes:
        photo_bytes: Size of one uploaded file.
        photo_pixels: Width times height, read from the header before anything is decoded.
        bodies: Requests whose bodies may arrive or wait at once; more get 429.
        bodies_bytes: Room for all of these together: two of the largest jobs, or many photos.
        waiting: Requests that may wait for the one worker; more get 429.
        upload_seconds: For the whole body of a request to arrive.
        answer_seconds: From the last byte of a request to its answer.
        pair_photos: Photos of one pair, those before and after together.
        job_pairs: Pairs in one job.
        job_bytes: Photos of one job together.
        stored_pairs: Pairs of all jobs that are kept or wait; more get 429.
        stored_bytes: What all jobs may hold together on disk; more get 429.
        keep_job_seconds: From when a job was sent until it and its results are deleted.
        keep_comparison_seconds: From the last use of a comparison until it is deleted.
        comparison_bytes: Memory for all comparisons that are kept.
    """

    photo_bytes: int = 25 * MEGA
    photo_pixels: int = 25 * MEGA
    bodies: int = 100
    bodies_bytes: int = 420 * MEGA
    waiting: int = 16
    upload_seconds: float = 30.0
    answer_seconds: float = 90.0
    pair_photos: int = 8
    job_pairs: int = 50
    job_bytes: int = 200 * MEGA
    stored_pairs: int = 1000
    stored_bytes: int = 4000 * MEGA
    keep_job_seconds: float = 24 * 3600.0
    keep_comparison_seconds: float = 15 * 60.0
    comparison_bytes: int = 600 * MEGA

    @property
    def photo(self) -> PhotoLimits:
        """The limits that `read_photo` checks."""
        return PhotoLimits(max_pixels=self.photo_pixels, max_file_bytes=self.photo_bytes)

    def body_bytes(self, path: str) -> int:
        """Return how large the body of a request to this path may be."""
        pair_bytes = 2 * self.photo_bytes
        photos = {
            "/v1/detect": pair_bytes,
            "/v1/comparisons": pair_bytes,
            "/v1/jobs": self.job_bytes,
        }
        return photos.get(path, 0) + FORM_BYTES
