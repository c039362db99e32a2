"""`/v1/comparisons`: a pair with progress, and results whose thresholds can be moved."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Path, Request, Response, status

from zeroscd.export.summary import summary
from zeroscd.serve.comparison_files import DOWNLOADS, FILES, render
from zeroscd.serve.forms import (
    UPLOAD_PROBLEMS,
    After,
    Before,
    Frame,
    Given,
    Preset,
    Sensitivity,
    SettingsText,
    check_pair,
    read_sides,
)
from zeroscd.serve.media import media_type
from zeroscd.serve.middleware import BODY
from zeroscd.serve.problems import Kind, Problem, described
from zeroscd.serve.schemas import ComparisonShown, ResultShown
from zeroscd.serve.sensitivity import threshold_at
from zeroscd.serve.service import Service, parse_values
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from zeroscd.serve.comparison import CachedResult, Comparison, Comparisons
    from zeroscd.serve.service import DetectRequest, Step

# Share of the work that is done before each step, in percent; roughly, as on the demo pair.
PERCENT: dict[Step, int] = {
    "wait": 3,
    "read": 10,
    "encode": 20,
    "compare": 55,
    "decide": 75,
    "draw": 92,
}
KEEP_SECONDS = 3600  # a file of one result never changes
Name = Annotated[str, Path(description="As POST /v1/comparisons returned it.", max_length=64)]


def router(service: Service, comparisons: Comparisons) -> APIRouter:
    """Return the routes of a service."""
    routes = APIRouter(prefix="/v1/comparisons", tags=["one pair, step by step"])
    _add_comparisons(routes, service, comparisons)
    _add_results(routes, service, comparisons)
    _add_files(routes, comparisons)
    return routes


def _add_comparisons(routes: APIRouter, service: Service, comparisons: Comparisons) -> None:
    @routes.post("", status_code=status.HTTP_202_ACCEPTED, responses=described(*UPLOAD_PROBLEMS))
    async def start(  # noqa: PLR0913, PLR0917 - the fields of the form
        http_request: Request,
        response: Response,
        before: Before,
        after: After,
        given: Given,
        preset: Preset = None,
        frame: Frame = None,
        sensitivity: Sensitivity = None,
        settings: SettingsText = None,
    ) -> ComparisonShown:
        """Queue a pair and return at once; ask for its status, then move its thresholds."""
        request = _request(service, preset, sensitivity, parse_values(settings, frame))
        photos = await read_sides(before, after, given)
        await check_pair(photos, service)
        name, comparison = comparisons.start(photos, request)
        comparisons.when_done(name, http_request.scope[BODY].hold())
        response.headers["Location"] = _address(http_request, name)
        return _shown(http_request, name, comparison, comparisons)

    @routes.get("/{name}", responses=described(404, 422))
    async def status_of(http_request: Request, name: Name) -> ComparisonShown:
        """Return the status of a comparison."""
        return _shown(http_request, name, _found(comparisons, name), comparisons)

    @routes.delete(
        "/{name}",
        status_code=status.HTTP_204_NO_CONTENT,
        response_model=None,
        responses=described(404, 422),
    )
    async def delete(name: Name) -> None:
        """Cancel a comparison, and delete its photos and results."""
        if not comparisons.remove(name):
            raise _unknown()


def _add_results(routes: APIRouter, service: Service, comparisons: Comparisons) -> None:
    @routes.post(
        "/{name}/results",
        status_code=status.HTTP_201_CREATED,
        responses=described(400, 404, 408, 409, 413, 422, 429, 503),
    )
    async def decide(  # noqa: PLR0913, PLR0917 - the fields of the form
        http_request: Request,
        response: Response,
        name: Name,
        frame: Frame = None,
        sensitivity: Sensitivity = None,
        settings: SettingsText = None,
    ) -> ResultShown:
        """Apply other thresholds; the photos are not encoded again."""
        comparison = _found(comparisons, name)
        if comparison.latest is None:
            reason = comparison.problem or f"it is {comparison.status}; ask again later"
            raise Problem(Kind.NOT_DONE, f"the comparison has no result: {reason}")
        values = parse_values(settings, frame)
        request = _request(service, comparison.preset, sensitivity, values)
        cancel_token = CancelToken()
        task = comparisons.decide(comparison, request, cancel_token)
        found = await service.wait_for(task, cancel_token, http_request)
        address = _address(http_request, name)
        response.headers["Location"] = f"{address}/results/{found.number}/changes.json"
        return _result(found, address)


def _add_files(routes: APIRouter, comparisons: Comparisons) -> None:
    @routes.get(
        "/{name}/results/{number}/{file}",
        response_class=Response,
        responses={
            200: {"content": {media_type(file): {} for file in FILES}},
            **described(404, 422),
        },
    )
    async def file_of(
        name: Name, number: Annotated[int, Path(ge=1)], file: Annotated[str, Path(max_length=64)]
    ) -> Response:
        """Return a picture, a download or the viewer of the latest result."""
        latest = _found(comparisons, name).latest
        if latest is None or file not in FILES or latest.number != number:
            raise Problem(Kind.NOT_FOUND, "no such file of the latest result")
        headers = {"Cache-Control": f"private, max-age={KEEP_SECONDS}, immutable"}
        if file in DOWNLOADS:
            headers["Content-Disposition"] = f'attachment; filename="{file}"'
        content = await asyncio.to_thread(render, file, latest)
        return Response(content, media_type=media_type(file), headers=headers)


def _request(
    service: Service, preset: str | None, sensitivity: float | None, values: dict[str, object]
) -> DetectRequest:
    """Return the request; a threshold among the values wins over the sensitivity."""
    request = service.request(preset, values)
    if sensitivity is None:
        return request
    threshold = threshold_at(sensitivity, service.detectors[request.preset])
    return service.request(preset, {**threshold, **values})


def _address(http_request: Request, name: str) -> str:
    return f"{http_request.scope['root_path']}/v1/comparisons/{name}"


def _shown(
    http_request: Request, name: str, comparison: Comparison, comparisons: Comparisons
) -> ComparisonShown:
    latest = comparison.latest
    finished = comparison.status in ("done", "failed")
    return ComparisonShown(
        id=name,
        preset=comparison.preset,
        status=comparison.status,
        step=comparison.step,
        percent=100 if finished else PERCENT[comparison.step],
        ahead=comparisons.ahead_of(name),
        problem=comparison.problem,
        result=None if latest is None else _result(latest, _address(http_request, name)),
    )


def _result(found: CachedResult, address: str) -> ResultShown:
    return ResultShown(
        number=found.number,
        summary=summary(found.result),
        regions=len(found.result.regions),
        files={file: f"{address}/results/{found.number}/{file}" for file in FILES},
    )


def _found(comparisons: Comparisons, name: str) -> Comparison:
    comparison = comparisons.get(name)
    if comparison is None:
        raise _unknown()
    return comparison


def _unknown() -> Problem:
    message = "no such comparison here; perhaps it has expired or was deleted"
    return Problem(Kind.NOT_FOUND, message)
