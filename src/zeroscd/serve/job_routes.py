"""`/v1/jobs`: many pairs, compared when there is time for them."""

from __future__ import annotations

import asyncio
import sqlite3
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, File, Path, Request, Response, UploadFile, status

from zeroscd.serve.forms import (
    PHOTO,
    RESULT,
    UPLOAD_PROBLEMS,
    Accept,
    Frame,
    Preset,
    SettingsText,
    check_pair,
)
from zeroscd.serve.job_store import UNFINISHED, JobStatus, JobStore
from zeroscd.serve.media import JSON, PNG, preferred
from zeroscd.serve.problems import Kind, Problem, described
from zeroscd.serve.schemas import JobShown, PairShown
from zeroscd.serve.service import PhotoPair, Service, parse_values

if TYPE_CHECKING:
    from zeroscd.serve.job_runner import JobRunner

RETRY_SECONDS = "60"
MAX_NUMBER = 1_000_000
JobName = Annotated[str, Path(description="As POST /v1/jobs returned it.", max_length=64)]

PairNumber = Annotated[int, Path(description="Counted from 0.", ge=0, le=MAX_NUMBER)]


def router(service: Service, store: JobStore, runner: JobRunner) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(prefix="/v1/jobs", tags=["many pairs"])
    _add_changing(routes, service, store, runner)
    _add_reading(routes, service, store)
    return routes


def _add_changing(routes: APIRouter, service: Service, store: JobStore, runner: JobRunner) -> None:
    @routes.post(
        "",
        response_model=JobShown,
        status_code=status.HTTP_202_ACCEPTED,
        responses=described(*UPLOAD_PROBLEMS),
    )
    async def send(  # noqa: PLR0913, PLR0917 - the fields of the form
        http_request: Request,
        response: Response,
        before: Annotated[list[UploadFile], File(description=f"The earlier photos: {PHOTO}")],
        after: Annotated[list[UploadFile], File(description="The later photos, in that order.")],
        preset: Preset = None,
        frame: Frame = None,
        settings: SettingsText = None,
    ) -> JobShown:
        """Queue pairs; once this is answered, not even a crash loses them."""
        values = parse_values(settings, frame)
        request = service.request(preset, values)
        pairs = await _pairs(before, after, service)
        await asyncio.to_thread(_check_room, store, service, pairs)
        try:
            job = await asyncio.to_thread(store.add, pairs, preset=request.preset, values=values)
        except sqlite3.OperationalError as error:  # a full disk
            raise _no_room() from error
        runner.wake()
        response.headers["Location"] = address = _address(http_request, job.id)
        return _shown(job, service, address)

    @routes.delete(
        "/{job}",
        status_code=status.HTTP_204_NO_CONTENT,
        response_model=None,
        responses=described(404, 422),
    )
    async def delete(job: JobName) -> None:
        """Cancel what has not started, and delete photos and results."""
        if not await asyncio.to_thread(store.remove, job):
            raise _unknown_job()


def _add_reading(routes: APIRouter, service: Service, store: JobStore) -> None:
    @routes.get("/{job}", response_model=JobShown, responses=described(404, 422))
    async def status_of(http_request: Request, job: JobName) -> JobShown:
        """Return the status of a job and of its pairs."""
        return _shown(await _found(store, job), service, _address(http_request, job))

    @routes.get(
        "/{job}/results/{number}",
        response_class=Response,
        responses={200: RESULT, **described(404, 406, 409, 422)},
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


async def _pairs(
    before: list[UploadFile], after: list[UploadFile], service: Service
) -> list[PhotoPair]:
    if len(before) != len(after):
        message = f"{len(before)} photos before and {len(after)} after; send as many of each"
        raise Problem(Kind.BAD_FIELDS, message)
    most = service.limits.job_pairs
    if len(before) > most:
        raise Problem(Kind.BAD_FIELDS, f"{len(before)} pairs in one job; send at most {most}")
    pairs = [
        PhotoPair(await one.read(), await other.read())
        for one, other in zip(before, after, strict=True)
    ]
    for number, pair in enumerate(pairs):
        await check_pair(pair, service, number=number)
    return pairs


def _check_room(store: JobStore, service: Service, pairs: list[PhotoPair]) -> None:
    limits = service.limits
    size = store.size_bytes() + sum(len(pair.before) + len(pair.after) for pair in pairs)
    if store.count() + len(pairs) > limits.stored_pairs or size > limits.stored_bytes:
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
