from __future__ import annotations

import pytest

from zeroscd.serve.media import JSON, PNG, preferred
from zeroscd.serve.problems import Problem


@pytest.mark.parametrize(
    ("accept", "media"),
    [
        ("", JSON),
        ("*/*", JSON),
        ("application/json", JSON),
        ("IMAGE/PNG", PNG),
        ("image/*", PNG),
        ("image/png;q=0.5, application/json", JSON),
        ("image/png, application/json;q=0.9", PNG),
        ("application/json;q=0, */*", PNG),
        ("text/html, */*;q=0.1", JSON),
        ("application/json;q=nonsense, image/png;q=0.2", PNG),
    ],
)
def test_the_answer_has_the_form_that_is_preferred(accept: str, media: str) -> None:
    assert preferred(accept) == media


@pytest.mark.parametrize("accept", ["text/html", "image/jpeg", "application/json;q=0", ";;;"])
def test_other_forms_do_not_exist(accept: str) -> None:
    with pytest.raises(Problem) as refused:
        preferred(accept)
    assert refused.value.status_code == 406
