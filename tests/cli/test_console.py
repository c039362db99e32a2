from __future__ import annotations

import io
import json
import warnings
from contextvars import copy_context
from typing import TYPE_CHECKING

import pytest

from zeroscd.cli.console import (
    answer,
    busy,
    fail,
    note,
    old_names_shown,
    one_line,
    say,
    set_audience,
    show,
    warn,
)
from zeroscd.cli.progress import Bar
from zeroscd.renamed import warn_renamed

if TYPE_CHECKING:
    from typing import Never


def test_results_go_to_stdout_and_the_rest_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    say("found")
    warn("careful")
    fail("broken")
    captured = capsys.readouterr()
    assert captured.out == "found\n"
    assert captured.err == "warning: careful\nerror: broken\n"


@pytest.mark.parametrize(
    ("audience", "out", "err"),
    [
        ({}, ["found", "a table"], ["by the way"]),
        ({"quiet": True}, [], []),
        ({"as_json": True}, [], ["found", "a table", "by the way"]),
        ({"quiet": True, "as_json": True}, [], []),
    ],
)
def test_programs_and_nobody_hear_no_more_than_they_want(
    audience: dict[str, bool], out: list[str], err: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    def command() -> None:
        set_audience(**audience)
        say("found")
        show("a table")
        note("by the way")
        warn("careful")
        fail("broken")
        answer({"a": 1})

    copy_context().run(command)
    captured = capsys.readouterr()
    assert captured.err.splitlines() == [*err, "warning: careful", "error: broken"]
    lines = captured.out.splitlines()
    assert lines[: len(out)] == out
    assert json.loads("".join(lines[len(out) :])) == {"a": 1}


def test_progress_is_hidden_from_those_who_want_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal(monkeypatch)

    def command() -> None:
        set_audience(quiet=True)
        with busy("comparing"), Bar("comparing") as bar:
            bar.begin(1)
            bar.advance("elm", reused=False)

    copy_context().run(command)
    assert screen.getvalue() == ""


def test_an_old_name_is_one_line_and_other_warnings_stay_as_they_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.warns(UserWarning, match="something else"), old_names_shown():  # noqa: PT031
        warn_renamed("old", "new")
        warnings.warn("something else", UserWarning, stacklevel=1)
    told = "warning: old is now new; the old name will be gone in zeroscd 0.3\n"
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("straße 日本.jpg", "straße 日本.jpg"),
        ("two\nlines\tand   gaps", "two lines and gaps"),
        ("\x1b]0;title\x07", "\\x1b]0;title\\x07"),
        ("\u202egpj.exe", "\\u202egpj.exe"),
        ("\udcff", "\\udcff"),
    ],
)
def test_text_becomes_one_safe_line(text: str, safe: str) -> None:
    assert one_line(text) == safe


def test_progress_is_silent_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with busy("comparing"):
        pass
    assert capsys.readouterr() == ("", "")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """A screen in the place of stderr."""
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    return screen


def test_progress_is_shown_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal(monkeypatch)
    with busy("comparing"):
        pass
    assert "comparing" in screen.getvalue()


def test_a_failure_passes_through_progress() -> None:
    def work() -> Never:
        raise KeyError

    with pytest.raises(KeyError), busy("comparing"):
        work()
