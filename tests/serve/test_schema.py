"""Schemathesis asks the server whatever its own OpenAPI document allows, and more."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import hypothesis
import pytest
from hypothesis import strategies as st

schemathesis = pytest.importorskip("schemathesis", reason="needs schemathesis")
checks = pytest.importorskip("schemathesis.specs.openapi.checks")

if TYPE_CHECKING:
    from collections.abc import Callable

EXAMPLES = 12  # for each operation; a search with thousands found nothing more


@pytest.mark.slow
def test_every_answer_is_one_that_the_document_promises(live: str, pair: Any) -> None:
    photos = st.sampled_from([pair.before, pair.after, pair.after[:999], b"", b"GIF89a"])
    schemathesis.openapi.format("binary", photos | st.binary(max_size=50))
    schema = schemathesis.openapi.from_url(f"{live}/openapi.json")
    asked = [check_operation(operation.ok()) for operation in schema.get_all_operations()]
    assert len(asked) == 14


def check_operation(operation: Any) -> str:
    profile: Callable[[Any], Any] = hypothesis.settings(
        max_examples=EXAMPLES,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )

    @profile
    @hypothesis.given(case=operation.as_strategy())
    def check(case: Any) -> None:
        # Most files are no photos, which no schema can say: refusing them is right.
        answer = case.call_and_validate(excluded_checks=[checks.positive_data_acceptance])
        assert answer.status_code < 500

    check()
    return str(operation.label)
