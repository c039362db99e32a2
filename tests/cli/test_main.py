from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import torch

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
        (["fly"], "No such command 'fly'; see `zeroscd --help`\n"),
        (["detct"], "No such command 'detct'; did you mean detect? (see `zeroscd --help`)\n"),
        (["index", "biuld"], "did you mean build? (see `zeroscd index --help`)\n"),
        (["--fly"], "No such option: --fly; see `zeroscd --help`\n"),
        (["--versoin"], "--versoin; did you mean --version? (see `zeroscd --help`)\n"),
        (["detect", "--also-befor", "c"], "did you mean --also-before? (see `zeroscd detect --h"),
        (["index", "query", "--wihtin", "5"], "mean --within? (see `zeroscd index query --help`)"),
        (["models"], "Missing command; see `zeroscd models --help`\n"),
        (["detect"], "Missing argument 'BEFORE'; see `zeroscd detect --help`\n"),
        (["detect", "a.jpg"], "Missing argument 'AFTER'; see `zeroscd detect --help`\n"),
        (["detect", "a.jpg", "b.jpg"], "Missing option '--out' / '-o'; see `zeroscd detect"),
        (["index", "query"], "Missing argument 'PHOTO'; see `zeroscd index query --help`\n"),
        (["detect", "a.jpg", "b.jpg", "-o"], "requires an argument; see `zeroscd detect --help`\n"),
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
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--write", "cocco"], "did you mean coco? (ch"),
        (["detect", "a.jpg", "b.jpg", "-o", "out", "--preset", "lit"], "did you mean lite? (ch"),
        (["batch", "a", "b", "-o", "out", "--write", "geojsn"], "did you mean geojson? (choose"),
        (["evaluate", "vl-cmu", "x", "-o", "out"], "did you mean vl-cmu-cd? (choose one of: fo"),
        (["models", "path", "sam-vit-bb"], "did you mean sam-vit-b? (choose one of: "),
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


def test_the_version_is_told_with_those_that_a_report_of_a_bug_needs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    assert run(["--version"]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first == f"zeroscd {__version__}"
    said = dict(line.split(" ", 1) for line in lines)
    assert said["torch"] == torch.__version__
    assert said["python"] == platform.python_version()
    assert (said["OMP_NUM_THREADS"], int(said["cores"]) > 0) == ("3", True)
    assert said["transformers"] == metadata.version("transformers")
    assert list(said) == [
        *("python", "platform", "cores", "OMP_NUM_THREADS"),
        *("torch", "numpy", "opencv-python-headless", "pillow", "transformers"),
    ]


def test_what_is_not_installed_is_left_out_of_the_versions_or_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def version(name: str) -> str:
        if name in ("pillow", "transformers"):
            raise metadata.PackageNotFoundError(name)
        return "1"

    monkeypatch.setattr(metadata, "version", version)
    assert run(["--version"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "pillow not installed" in lines
    assert not [line for line in lines if line.startswith("transformers")]


def complete(words: str) -> list[str]:
    """What a shell offers for the last of some words."""
    setting = {"_ZEROSCD_COMPLETE": "complete_bash", "COMP_WORDS": words}
    place = {"COMP_CWORD": str(len(words.split()) - 1)}
    command = [sys.executable, "-c", "from zeroscd.cli.main import main; main()"]
    done = subprocess.run(
        command, env=os.environ | setting | place, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("zeroscd det", ["detect"]),
        ("zeroscd detect --also-b", ["--also-before"]),
        ("zeroscd detect --preset dinov2", ["dinov2-s", "dinov2-b"]),
        ("zeroscd evaluate pcd", ["pcd2015-tsunami", "pcd2015-gsv"]),
        ("zeroscd models fetch mobile", ["mobile-sam"]),
    ],
)
def test_the_shell_completes_commands_options_and_names(words: str, offered: list[str]) -> None:
    assert complete(words) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_completion_of_each_shell_asks_zeroscd(
    shell: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("shellingham.detect_shell", lambda: (shell, f"/bin/{shell}"))
    with pytest.raises(SystemExit) as done:
        run(["--show-completion"])
    assert done.value.code == 0
    script = capsys.readouterr().out
    assert f"_ZEROSCD_COMPLETE=complete_{shell}" in script
    assert "zeroscd" in script.split()


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


@pytest.mark.parametrize(
    "arguments", [["--help"], ["detect", "--help"], ["evaluate", "--help"], ["--version"]]
)
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
