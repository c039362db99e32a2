"""Compares the pairs of jobs one by one, in turn with the requests that somebody waits for."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from typing import TYPE_CHECKING

from zeroscd.errors import ZeroscdError
from zeroscd.export.changes import changes_json
from zeroscd.export.pictures import png
from zeroscd.serve.job_records import Finished
from zeroscd.serve.problems import MISTAKE
from zeroscd.serve.worker import CancelToken

if TYPE_CHECKING:
    from zeroscd.serve.job_records import Work
    from zeroscd.serve.job_store import JobStore
    from zeroscd.serve.service import Service

log = logging.getLogger(__name__)

RETRY_SECONDS = 30.0  # after an error of the database


class JobRunner:
    """Hands the worker one pair at a time, so that a request never waits for a whole job."""

    def __init__(self, store: JobStore, service: Service) -> None:
        self._store = store
        self._service = service
        self._new = asyncio.Event()

    def wake(self) -> None:
        """Tell the runner that a job was added; call it in the event loop."""
        self._new.set()

    async def run(self) -> None:
        """Work until cancelled."""
        while True:
            try:
                await asyncio.to_thread(self._store.recover)
                await self._work()
            except (
                sqlite3.Error
            ) as error:  # a full disk, mostly; all that was acknowledged is there
                log.error("no job is run for %.0f seconds: %s", RETRY_SECONDS, error)  # noqa: TRY400
            except Exception:
                log.exception("no job is run for %.0f seconds", RETRY_SECONDS)
            await asyncio.sleep(RETRY_SECONDS)

    async def _work(self) -> None:
        while True:
            self._new.clear()
            while work := await asyncio.to_thread(self._store.claim):
                await self._compare(work)
            await self._new.wait()

    async def _compare(self, work: Work) -> None:
        task = self._service.worker.submit(lambda: self._result_of(work), always=True)
        answer = asyncio.wrap_future(task)
        try:
            await asyncio.wait({answer})
        except asyncio.CancelledError:
            self._store.release(work)
            raise
        error = answer.exception()
        if error is None:
            await asyncio.to_thread(self._store.finish, work, answer.result())
        elif isinstance(error, ZeroscdError):
            await asyncio.to_thread(self._store.fail, work, str(error))
        else:  # one pair's error must not end all other jobs
            log.error("pair %d of job %s", work.number, work.job, exc_info=error)
            await asyncio.to_thread(self._store.fail, work, MISTAKE)

    def _result_of(self, work: Work) -> Finished:
        request = self._service.request(work.preset, work.values)
        evidence = self._service.gather(work.photos, request, CancelToken())
        result = self._service.decide(evidence, request)
        return Finished(changes_json(result), png(result.mask))
