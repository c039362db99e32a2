"""`/v1/jobs`: many pairs, compared when there is time for them."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, File, Form, Path, Request, Response, UploadFile, status

from zeroscd.serve.forms import (
    PHOTO,
    RESULT,
    UPLOAD_PROBLEMS,
    Accept,
    Frame,
    Preset,
    SettingsText,
    refuse_given,
)
from zeroscd.serve.job_store import UNFINISHED, JobStore
from zeroscd.serve.job_upload import check_pairs, group_pairs, read_pairs
from zeroscd.serve.media import JSON, PNG, preferred
from zeroscd.serve.problems import Kind, Problem, described
from zeroscd.serve.schemas import JobShown, PairShown
from zeroscd.serve.service import Service, parse_values

if TYPE_CHECKING:
    from zeroscd.serve.job_records import JobStatus
    from zeroscd.serve.job_runner import JobRunner

RETRY_SECONDS = "60"
MAX_NUMBER = 1_000_000
JobName = Annotated[str, Path(description="As POST /v1/jobs returned it.", max_length=64)]

PairNumbers = Annotated[
    list[int] | None,
    Form(
        description="Where a pair has several photos on a side: the pair of each photo of that "
        "side, counted from 0, as often as there are photos; the first one gives the frame.",
        examples=[[0, 0, 1]],
    ),
]
PairNumber = Annotated[int, Path(description="Counted from 0.", ge=0, le=MAX_NUMBER)]


def router(service: Service, store: JobStore, runner: JobRunner) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(prefix="/v1/jobs", tags=["many pairs"])
    _add_sending(routes, service, store, runner)
    _add_deleting(routes, store)
    _add_reading(routes, service, store)
    return routes


def _add_sending(routes: APIRouter, service: Service, store: JobStore, runner: JobRunner) -> None:
    adding = asyncio.Lock()  # two jobs must not find the same room

    @routes.post(
        "",
        response_model=JobShown,
        status_code=status.HTTP_202_ACCEPTED,
        responses=described(*UPLOAD_PROBLEMS, 503),
    )
    async def send(  # noqa: PLR0913, PLR0917 - the fields of the form
        http_request: Request,
        response: Response,
        before: Annotated[list[UploadFile], File(description=f"The earlier photos: {PHOTO}")],
        after: Annotated[list[UploadFile], File(description="The later photos, in that order.")],
        before_of: PairNumbers = None,
        after_of: PairNumbers = None,
        preset: Preset = None,
        frame: Frame = None,
        settings: SettingsText = None,
    ) -> JobShown:
        """Queue pairs; once this is answered, not even a crash loses them."""
        await refuse_given(http_request)
        values = parse_values(settings, frame)
        request = service.request(preset, values)
        files = group_pairs(before, after, before_of=before_of, after_of=after_of)
        await check_pairs(files, service)
        size_bytes = sum(each.size or 0 for each in (*before, *after))
        async with adding:
            await asyncio.to_thread(check_room, store, service, len(files), size_bytes)
            job = await asyncio.to_thread(
                store.add, read_pairs(files), preset=request.preset, values=values
            )
        runner.wake()
        response.headers["Location"] = address = _address(http_request, job.id)
        return _shown(job, service, address)


def _add_deleting(routes: APIRouter, store: JobStore) -> None:
    @routes.delete(
        "/{job}",
        status_code=status.HTTP_204_NO_CONTENT,
        response_model=None,
        responses=described(404, 422, 503, 507),
    )
    async def delete(job: JobName) -> None:
        """Cancel what has not started, and delete photos and results."""
        if not await asyncio.to_thread(store.remove, job):
            raise _unknown_job()


def _add_reading(routes: APIRouter, service: Service, store: JobStore) -> None:
    @routes.get("/{job}", response_model=JobShown, responses=described(404, 422, 503, 507))
    async def status_of(http_request: Request, job: JobName) -> JobShown:
        """Return the status of a job and of its pairs."""
        return _shown(await _found(store, job), service, _address(http_request, job))

    @routes.get(
        "/{job}/results/{number}",
        response_class=Response,
        responses={200: RESULT, **described(404, 406, 409, 422, 503, 507)},
    )
    async def result(
        job: JobName,
        number: PairNumber,
        accept: Accept = JSON,
    ) -> Response:
        """Return what changed between the photos of one pair."""
        media = preferred(accept)
        found = await asyncio.to_thread(store.finished, job, number)
        if found is None:
            raise _why_not(await _found(store, job), number)
        return Response(found.mask if media == PNG else found.changes, media_type=media)


def check_room(store: JobStore, service: Service, pairs: int, size_bytes: int) -> None:
    """Check that there is room for so many more pairs, with so many bytes of photos.

    Raises:
        Problem: There is not.
    """
    limits = service.limits
    is_full = store.count() + pairs > limits.stored_pairs
    if is_full or store.size_bytes() + size_bytes > limits.stored_bytes:
        raise _no_room()


def _no_room() -> Problem:
    message = "there is no room for more jobs; delete some or try again later"
    return Problem(Kind.BUSY, message, headers={"Retry-After": RETRY_SECONDS})


async def _found(store: JobStore, job: str) -> JobStatus:
    found = await asyncio.to_thread(store.status, job)
    if found is None:
        raise _unknown_job()
    return found


def _unknown_job() -> Problem:
    return Problem(Kind.NOT_FOUND, "no such job here; perhaps it has expired or was deleted")


def _why_not(job: JobStatus, number: int) -> Problem:
    for pair in job.pairs:
        if pair.number == number:
            reason = pair.problem or f"it is {pair.status}; ask again later"
            return Problem(Kind.NOT_DONE, f"pair {number} has no result: {reason}")
    return Problem(Kind.NOT_FOUND, f"the job has {len(job.pairs)} pairs, counted from 0")


def _address(http_request: Request, job: str) -> str:
    return f"{http_request.scope['root_path']}/v1/jobs/{job}"


def _shown(job: JobStatus, service: Service, address: str) -> JobShown:
    states = {pair.status for pair in job.pairs}
    started = states - {"waiting"}
    return JobShown(
        id=job.id,
        status=("running" if started else "waiting") if states & set(UNFINISHED) else "done",
        preset=job.preset,
        created=_utc(job.created),
        expires=_utc(job.created + service.limits.keep_job_seconds),
        pairs=[
            PairShown(
                number=pair.number,
                status=pair.status,
                problem=pair.problem,
                result=f"{address}/results/{pair.number}" if pair.status == "done" else None,
            )
            for pair in job.pairs
        ],
    )


def _utc(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
