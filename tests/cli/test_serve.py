from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from filelock import FileLock

pytest.importorskip("fastapi", reason="the server needs zeroscd[serve]")

from zeroscd import extras
from zeroscd.cli.main import run
from zeroscd.serve import run as server
from zeroscd.serve.run import Plan, clean_spool, listen

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def plans(monkeypatch: pytest.MonkeyPatch) -> list[Plan]:
    """Serve nothing, but note what was to be served."""
    asked: list[Plan] = []

    def serve(plan: Plan, *, ready: Any) -> None:
        asked.append(plan)
        ready("http://127.0.0.1:1")

    monkeypatch.setattr(server, "serve", serve)
    return asked


def test_without_options_only_this_machine_is_served(
    plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["serve"]) == 0
    (plan,) = plans
    assert (plan.host, plan.port, plan.presets, plan.keys) == ("127.0.0.1", 8000, ["lite"], [])
    assert capsys.readouterr().out == "listening at http://127.0.0.1:1 (Ctrl+C stops)\n"


def test_settings_of_all_requests_are_given_once(
    plans: list[Plan], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["serve", "--set", "vegetation=ignore"]) == 0
    assert plans[0].overrides == {"vegetation": "ignore"}
    assert run(["serve", "--set", "vegetation=gone"]) == 2
    assert "choose one of: report, ignore" in capsys.readouterr().err


def test_a_path_prefix_loses_its_last_slash(plans: list[Plan]) -> None:
    assert run(["serve", "--root-path", "/zeroscd/"]) == 0
    assert plans[0].root_path == "/zeroscd"


def test_names_of_the_server_are_read_in_any_spelling(plans: list[Plan]) -> None:
    assert run(["serve", "--allow-host", "City.example", "--allow-host", "b.example."]) == 0
    assert plans[0].allowed_hosts == ["city.example", "b.example"]


def test_keys_come_from_the_environment_and_are_never_shown(
    plans: list[Plan], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KEY_A", "s3cret")
    monkeypatch.setenv("KEY_B", "other ")
    assert run(["serve", "--api-key-env", "KEY_A", "--api-key-env", "KEY_B"]) == 0
    assert plans[0].keys == ["s3cret", "other"]
    assert "s3cret" not in str(capsys.readouterr())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--api-key-env", "NO_SUCH_NAME"], "NO_SUCH_NAME"),
        (["--preset", "nope"], "unknown preset 'nope'"),
        (["--port", "70000"], "65535"),
        (["--allow-host", "https://a.example"], "--allow-host 'https://a.example' is no plain"),
        (["--root-path", "//evil.example"], "--root-path '//evil.example' is not a plain path"),
    ],
)
def test_a_wrong_option_gives_one_line(
    plans: list[Plan], capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert run(["serve", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert words in error
    assert plans == []


def test_a_missing_extra_says_what_to_install(
    plans: list[Plan], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        extras, "find_spec", lambda name: None if name == "python_multipart" else find_spec(name)
    )
    assert run(["serve"]) == 2
    assert capsys.readouterr().err == (
        "error: serve needs python-multipart; run: pip install 'zeroscd[serve]'\n"
    )
    assert plans == []


def test_a_port_in_use_gives_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with listen("127.0.0.1", 0) as taken:
        port = str(taken.getsockname()[1])
        assert run(["serve", "--port", port, "--state", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert re.fullmatch(rf"error: cannot listen at 127.0.0.1 port {port} .*--port.*\n", error)
    assert list(tmp_path.iterdir()) == []


def test_an_address_of_another_machine_gives_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", "--host", "192.0.2.1", "--port", "0"]) == 2
    assert "cannot listen at 192.0.2.1" in capsys.readouterr().err


def test_two_servers_do_not_share_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with FileLock(tmp_path / "lock"):
        assert run(["serve", "--port", "0", "--state", str(tmp_path)]) == 2
    assert "another server uses" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_gives_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    assert run(["serve", "--port", "0", "--state", str(tmp_path / "file")]) == 2
    assert "--state" in capsys.readouterr().err


def test_what_a_crash_left_in_the_spool_is_gone_at_the_next_start(tmp_path: Path) -> None:
    spool = clean_spool(tmp_path)
    (spool / "left").mkdir()
    (spool / "left" / "over.jpg").write_bytes(b"x")
    (tmp_path / "jobs.sqlite3").write_bytes(b"kept")
    assert list(clean_spool(tmp_path).iterdir()) == []
    assert (tmp_path / "jobs.sqlite3").exists()


def test_addresses_of_both_families_can_be_listened_at() -> None:
    with listen("localhost", 0) as listening:
        assert listening.getsockname()[1] > 0
        assert listening.family in (socket.AF_INET, socket.AF_INET6)


@pytest.mark.slow
def test_the_command_serves_until_it_is_asked_to_stop(tmp_path: Path) -> None:
    entry = "from zeroscd.cli.main import main; main()"
    arguments = ["serve", "--port", "0", "--state", str(tmp_path)]
    with subprocess.Popen(
        [sys.executable, "-c", entry, *arguments], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
        assert found is not None
        with httpx.Client(base_url=found[0], timeout=60) as client:
            names = [preset["name"] for preset in client.get("/v1/presets").json()["presets"]]
            assert names == ["lite"]
            photos = {
                when: client.get(f"/samples/{when}.jpg").content for when in ("before", "after")
            }
            kinds = {
                region["kind"]
                for region in client.post("/v1/detect", files=photos).json()["regions"]
            }
            assert kinds == {"removed", "added"}
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) in (0, -signal.SIGTERM)
