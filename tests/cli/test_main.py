from __future__ import annotations

import os
import resource
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from zeroscd import __version__
from zeroscd.cli.main import run

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).parents[2]
SLOW_MODULES = ("torch", "cv2", "numpy", "PIL")
HELP_CPU_SECONDS = 1.0  # 0.35 on a two-core machine; three times that on a busy one


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def outcome_and_slow_imports(*arguments: str) -> list[str]:
    """Run a command in a fresh process: its exit code, then the slow modules it imported."""
    code = (
        "import sys; from zeroscd.cli.main import run; code = run(sys.argv[1:]); "
        f"print('\\nEND', code, *[m for m in {SLOW_MODULES} if m in sys.modules])"
    )
    return python(code, *arguments).stdout.rpartition("END")[2].split()


def one_error_line(text: str) -> str:
    assert text.startswith("error: ")
    assert text.endswith("\n")
    assert text.count("\n") == 1
    return text


LONG = "a" * 300  # more than any file system takes
READERS = (
    ["evaluate", "folder"],
    ["evaluate", "vl-cmu-cd"],
    ["ablate", "folder", "--over", "tau=1"],
    ["index", "build"],
)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["fly"], "No such command 'fly'"),
        (["--fly"], "No such option: --fly"),
        (["models"], "Missing command"),
        (["detect"], "Missing argument 'BEFORE'"),
        (["detect", "a.jpg"], "Missing argument 'AFTER'"),
        (["detect", "a.jpg", "b.jpg"], "Missing option '--out'"),
        (["detect", "a.jpg", "b.jpg", "-o"], "requires an argument"),
        (["detect", "a.jpg", "b.jpg", "c.jpg", "-o", "out"], "c.jpg"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--frame", "t2"], "'t2' is not one of"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--device", "tpu"], "'tpu' is not one of"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--preset", "best"], "unknown preset 'best'"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--set", "tau"], "--set needs KEY=VALUE"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--set", "t=1"], "unknown setting 't'; `z"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--set", "tua=1"], "did you mean tau?"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--set", "tau=x"], "not 'x'"),
        (["detect", "a.jpg", "b.jpg", "-o", "in_the_way"], "in_the_way is not a folder"),
        (["demo", "-o", "in_the_way/deeper"], "in_the_way is not a folder"),
        (["detect", "missing.jpg", "b.jpg", "-o", "out"], "missing.jpg does not exist"),
        (["detect", "a.jpg", "b.jpg", "-o", ""], "after `zeroscd detect a.jpg b.jpg -o` is empty"),
        (["detect", "in_the_way", "b.jpg", "-o", "out"], "in_the_way"),
        *(([*words, LONG, "-o", "out"], LONG) for words in READERS),
        (["batch", LONG, LONG, "-o", "out"], LONG),
        (["batch", f"{LONG}.csv", "-o", "out"], LONG),
    ],
)
def test_what_a_user_gets_wrong_is_one_line_and_leaves_nothing_behind(
    arguments: Sequence[str],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in_the_way").write_text("a file")
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert reason in one_error_line(captured.err)
    assert captured.out == "" or arguments == ["models"]  # which shows its help there
    assert [path.name for path in tmp_path.iterdir()] == ["in_the_way"]


def test_a_file_name_cannot_move_the_cursor_or_break_the_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "a\x1b[31m\r\nb\udcff\u202e.jpg"
    assert run(["detect", str(tmp_path / name), "b.jpg", "-o", str(tmp_path / "out")]) == 2
    line = one_error_line(capsys.readouterr().err)
    assert line.removesuffix("\n").isprintable()
    assert "\\x1b[31m" in line


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"zeroscd {__version__}\n"


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_lists_every_command(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 0
    text = capsys.readouterr().out
    assert all(f" {name} " in text for name in ("demo", "detect", "evaluate", "ablate", "models"))


def test_help_of_detect_has_an_example_and_the_defaults(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["detect", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "zeroscd detect before.jpg after.jpg -o changes" in text
    assert "[default: lite]" in text
    assert "[default: auto]" in text


@pytest.mark.parametrize("arguments", [["--help"], ["detect", "--help"], ["evaluate", "--help"]])
def test_help_imports_nothing_slow(arguments: list[str]) -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert outcome_and_slow_imports(*arguments) == ["0"]
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime - before.ru_utime < HELP_CPU_SECONDS


@pytest.mark.parametrize(
    "wrong", [["--preset", "best"], ["--set", "tau=x"], ["--device", "tpu"], ["--set", "x=1"]]
)
def test_a_wrong_option_is_refused_before_anything_slow_is_imported(wrong: list[str]) -> None:
    arguments = ["detect", "a.jpg", "b.jpg", "-o", "out", *wrong]
    assert outcome_and_slow_imports(*arguments) == ["2"]


def test_a_missing_photo_is_refused_before_torch_is_imported(tmp_path: Path) -> None:
    arguments = ["detect", "a.jpg", "b.jpg", "-o", str(tmp_path / "out")]
    assert "torch" not in outcome_and_slow_imports(*arguments)


def test_the_process_exits_with_the_code_and_one_line() -> None:
    done = python("import sys; from zeroscd.cli.main import main; sys.argv[1:] = ['fly']; main()")
    assert done.returncode == 2
    assert done.stderr == "error: No such command 'fly'; see `zeroscd --help`\n"


def test_ctrl_c_while_the_command_line_is_imported_is_no_traceback() -> None:
    code = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from zeroscd.__main__ import main; main()"
    )
    done = python(code)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_the_installed_command_and_python_m_are_the_same_program() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"zeroscd": "zeroscd.__main__:main"}
    command = [sys.executable, "-m", "zeroscd", "fly"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "error: No such command 'fly'; see `zeroscd --help`\n"


def test_a_reader_who_leaves_early_sees_no_traceback() -> None:
    code = (
        "import sys; from zeroscd.cli import main; "
        "main.run = lambda arguments: print('result') or 0; main.main()"
    )
    read_end, write_end = os.pipe()
    os.close(read_end)
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=write_end, stderr=subprocess.PIPE, text=True
    )
    os.close(write_end)
    _, complaints = process.communicate()
    assert complaints == ""
    assert process.returncode == 1


@pytest.mark.parametrize(
    ("where", "code", "complaints"),
    [
        (">&-", 0, ""),
        (
            "> /dev/full",
            2,
            "error: cannot write to the standard output: no space left; make room\n",
        ),
    ],
)
def test_a_result_that_nobody_can_read_is_no_traceback(
    where: str, code: int, complaints: str
) -> None:
    program = "from zeroscd.cli.main import main; import sys; sys.argv[1:] = ['--version']; main()"
    command = f'"{sys.executable}" -c "{program}" {where}'
    done = subprocess.run(["/bin/sh", "-c", command], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (code, complaints)
