"""What was tried on a server and what it survived, as a table, for `serve.py`."""

from __future__ import annotations

from typing import Any

MEGABYTE = 1e6
MOST_BYTES = 900e6  # of the server, at any time
KEPT_BYTES = 600e6  # of comparisons that the page's visitors may move on, beside that


def table(found: dict[str, Any]) -> str:
    """Write what was tried and survived as a Markdown table."""
    rows = [
        *_table_rows(found, "headers", ""),
        *_table_rows(found, "idle", "300 idle connections: "),
    ]
    if "jobs" in found:
        each = found["jobs"]
        tried = f"{each['clients']} clients with jobs of {each['megabytes_each']} MB"
        rows.append((tried, _is_alive(each) and each["alive_afterwards"], _told(each)))
    for kind, each in found.get("crosssite", {}).items():
        is_ours = kind in {"curl", "our own page", "a proxy's name"}
        right = [200, 200] if is_ours else [403, 403]
        rows.append((f"request: {kind}", each["statuses"] == right, str(each["statuses"])))
    if "disk" in found:
        each = found["disk"]
        survived = _is_alive(each) and each["tracebacks"] == 0 and set(each["pairs"]) == {"done"}
        rows.append(("a full disk", survived, f"{_told(each)}; afterwards {each['pairs']}"))
    if "kill" in found:
        each = found["kill"]
        lost = f"{each['jobs_lost']} of {each['jobs_acknowledged']} jobs lost"
        rows.append((f"killed {each['kills']} times", each["jobs_lost"] == 0, lost))
    rows += _crowd_rows(found)
    if "commandline" in found:
        rows += _commandline_rows(found["commandline"])
    lines = [f"| {what} | {'yes' if good else 'NO'} | {told} |" for what, good, told in rows]
    return "\n".join(
        [*_circumstances(found), "| tried | survived | |", "|---|---|---|", *lines, ""]
    )


def _crowd_rows(found: dict[str, Any]) -> list[tuple[str, bool, str]]:
    """Many clients, many visitors of the page, many hostile uploads."""
    rows = []
    if "load" in found:
        each = found["load"]
        survived = _is_alive(each) and set(each["statuses"]) <= {"200", "429"}
        rows.append((f"{each['clients']} clients for {each['seconds']} s", survived, _told(each)))
    if "page" in found:
        each = found["page"]
        answered = set(each["statuses"]) <= {"200", "201", "202", "429"}
        survived = answered and _is_alive(each, MOST_BYTES + KEPT_BYTES)
        tried = f"{each['visitors']} visitors of the page for {each['seconds']} s"
        rows.append((tried, survived, _told(each)))
    if "hostile" in found:
        each = found["hostile"]
        survived = _is_alive(each) and not each["not_4xx"] and each["alive_afterwards"]
        told = f"{_told(each)}; {each['not_4xx']} answers that are not 4xx"
        rows.append((f"{each['uploads']} hostile uploads", survived, told))
    return rows


def _circumstances(found: dict[str, Any]) -> list[str]:
    """Say when it was measured, and how busy the machine was with other work."""
    dates, busy = zip(
        *((each["date"], each["cores_of_others"]) for each in found["measured"].values()),
        strict=True,
    )
    days = " to ".join(sorted({min(dates), max(dates)}))
    shared = f"other programs used {min(busy)} to {max(busy)} of its cores meanwhile"
    return [f"Measured on {days}; the machine was shared: {shared}.", ""]


def _table_rows(found: dict[str, Any], key: str, what: str) -> list[tuple[str, bool, str]]:
    return [
        (what + kind, _is_alive(each), _told(each)) for kind, each in found.get(key, {}).items()
    ]


def _is_alive(each: dict[str, Any], most_bytes: float = MOST_BYTES) -> bool:
    probe = each["healthz"]
    return probe["slowest_seconds"] < 1 and not probe["failed"] and each["most_bytes"] < most_bytes


def _told(each: dict[str, Any]) -> str:
    parts = [
        f"`/healthz` within {each['healthz']['slowest_seconds']} s",
        f"{each['most_bytes'] / MEGABYTE:.0f} MB at most",
    ]
    if "statuses" in each:
        parts.append(", ".join(f"{count} x {status}" for status, count in each["statuses"].items()))
    if "oldest_seconds" in each:
        parts.append(f"all closed after {each['oldest_seconds']} s")
    return "; ".join(parts)


def _commandline_rows(found: dict[str, Any]) -> list[tuple[str, bool, str]]:
    rows = []
    for kind, each in found["files"].items():
        survived = (each["exit_code"], each["lines"]) == (2, 1) and each["wall_s_beyond_start"] < 1
        told = (
            f"{each['lines']} line; {each['wall_s']} s, of which {each['wall_s_beyond_start']} s "
            f"beyond the start of `zeroscd --version` ({each['cpu_s_beyond_start']} s of processor "
            f"time)"
        )
        rows.append((f"`zeroscd detect`: {kind}", survived, told))
    return rows
