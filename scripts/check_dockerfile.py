#!/usr/bin/env python3
"""Check that the Dockerfile does what docs/serve.md tells a person to do; exit 1 if not."""

from __future__ import annotations

import json
import re
import shlex
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = "docs/serve.md"


def problems(root: Path = ROOT) -> list[str]:
    """Return one line for everything that does not fit; nothing if all does."""
    steps = instructions((root / "Dockerfile").read_text(encoding="utf-8"))
    page = (root / PAGE).read_text(encoding="utf-8")
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [
        *check_base(steps, project["requires-python"]),
        *check_install(steps, page, project["optional-dependencies"]),
        *check_copies(steps, root),
        *check_user(steps),
        *check_command(steps, page),
    ]


def instructions(text: str) -> list[tuple[str, str]]:
    """Split a Dockerfile into instructions and their arguments, lines joined, comments gone."""
    joined = re.sub(r"\\\n\s*", "", re.sub(r"^#.*\n", "", text, flags=re.MULTILINE))
    pairs = (line.partition(" ") for line in joined.splitlines() if line.strip())
    return [(name.upper(), rest.strip()) for name, _, rest in pairs]


def check_base(steps: list[tuple[str, str]], wanted: str) -> list[str]:
    bases = [rest for name, rest in steps if name == "FROM"]
    if len(bases) != 1:
        return ["one base image is expected"]
    tag = re.fullmatch(r"python:(\d+)\.(\d+)\.\d+-slim-\w+", bases[0])
    if tag is None:
        return [f"the base {bases[0]!r} is not pinned to a Python patch release and a system"]
    least = tuple(int(part) for part in re.findall(r"\d+", wanted))
    if (int(tag[1]), int(tag[2])) < least:
        return [f"the base {bases[0]!r} is older than requires-python {wanted}"]
    return []


def check_install(
    steps: list[tuple[str, str]], page: str, extras: dict[str, list[str]]
) -> list[str]:
    runs = " && ".join(rest for name, rest in steps if name == "RUN")
    installs = re.findall(r"pip install [^&]*'(\.\[(\w+)\])'", runs)
    if len(installs) != 1:
        return ["one `pip install '.[EXTRA]'` is expected"]
    what, extra = installs[0]
    found = [] if extra in extras else [f"pyproject.toml has no extra {extra!r}"]
    if f"pip install '{what}'" not in page:
        found.append(f"{PAGE} does not say: pip install '{what}'")
    return found


def check_copies(steps: list[tuple[str, str]], root: Path) -> list[str]:
    names = [name for step, rest in steps if step == "COPY" for name in rest.split()[:-1]]
    found = [f"COPY {name}: not there" for name in names if not (root / name).exists()]
    allowed = (root / ".dockerignore").read_text(encoding="utf-8").splitlines()
    found += [f".dockerignore keeps {name} out" for name in names if f"!{name}" not in allowed]
    if "*" not in allowed:
        found.append(".dockerignore lets everything in")
    return found


def check_user(steps: list[tuple[str, str]]) -> list[str]:
    order = [name for name, _ in steps]
    users = [rest for name, rest in steps if name == "USER"]
    if users in ([], ["root"], ["0"]):
        return ["the server runs as root"]
    runs_late = "RUN" in order[order.index("USER") :]
    return ["RUN after USER"] if runs_late else []


def check_command(steps: list[tuple[str, str]], page: str) -> list[str]:
    last = dict(steps)
    command = shlex.join(json.loads(last["CMD"]))
    port = re.search(r"--port (\d+)", command)
    found = [] if command in page else [f"{PAGE} does not say: {command}"]
    if port is None or last.get("EXPOSE") != port[1]:
        found.append("EXPOSE and --port differ")
    elif f":{port[1]}/healthz" not in last.get("HEALTHCHECK", ""):
        found.append("HEALTHCHECK does not ask the server's own /healthz")
    if last.get("VOLUME") not in command.split():
        found.append("--state is not the VOLUME")
    for line in ("docker build", "docker run"):
        if line not in page:
            found.append(f"{PAGE} does not say how to {line}")
    return found


def main() -> int:
    found = problems()
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
