"""The Dockerfile and docs/serve.md agree: nothing here can build the image."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "serve.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def steps() -> list[tuple[str, str]]:
    """Instructions and their arguments, in order; lines joined, comments gone."""
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    joined = re.sub(r"\\\n\s*", "", re.sub(r"^#.*\n", "", text, flags=re.MULTILINE))
    pairs = (line.partition(" ") for line in joined.splitlines() if line.strip())
    return [(name, rest.strip()) for name, _, rest in pairs]


def test_the_base_is_pinned_and_new_enough(steps: list[tuple[str, str]]) -> None:
    (base,) = (rest for name, rest in steps if name == "FROM")
    tag = re.fullmatch(r"python:(\d+)\.(\d+)\.\d+-slim-\w+", base)
    assert tag is not None
    oldest = [int(part) for part in re.findall(r"\d+", PROJECT["requires-python"])]
    assert [int(tag[1]), int(tag[2])] >= oldest


def test_the_extra_that_is_installed_exists(steps: list[tuple[str, str]]) -> None:
    runs = " ".join(rest for name, rest in steps if name == "RUN")
    (extra,) = re.findall(r"pip install [^&]*'\.\[(\w+)\]'", runs)
    assert extra in PROJECT["optional-dependencies"]
    assert f"pip install '.[{extra}]'" in PAGE


def test_what_is_copied_is_there_and_nothing_else_is_sent(steps: list[tuple[str, str]]) -> None:
    copied = {name for step, rest in steps if step == "COPY" for name in rest.split()[:-1]}
    assert [name for name in copied if not (ROOT / name).exists()] == []
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert "*" in ignored
    assert {f"!{name}" for name in copied} <= set(ignored)


def test_the_server_runs_without_rights(steps: list[tuple[str, str]]) -> None:
    order = [name for name, _ in steps]
    assert dict(steps)["USER"] not in ("root", "0")
    assert "RUN" not in order[order.index("USER") :]


def test_the_command_is_the_one_of_the_page(steps: list[tuple[str, str]]) -> None:
    last = dict(steps)
    command = shlex.join(json.loads(last["CMD"]))
    assert command in PAGE
    assert "docker build" in PAGE
    assert "docker run" in PAGE
    port = command.split()[command.split().index("--port") + 1]
    assert last["EXPOSE"] == port
    assert f":{port}/healthz" in last["HEALTHCHECK"]
    assert last["VOLUME"] in command.split()
