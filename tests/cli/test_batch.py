from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd import batch
from zeroscd.batch.cluster import Ray
from zeroscd.cli.batch import pick_engine
from zeroscd.cli.main import run
from zeroscd.cli.options import parse_files
from zeroscd.errors import SettingsError
from zeroscd.export.files import NAMES

if TYPE_CHECKING:
    from pathlib import Path


@dataclass
class Asked:
    """What the command asked of the batch."""

    manifest: Any = None
    out: Any = None
    options: Any = None
    engine: Any = None
    answer: batch.Summary = field(default_factory=lambda: batch.Summary(pairs=3, regions=7))
    failure: BaseException | None = None

    def __call__(
        self, manifest: Any, out: Any, *, options: Any, engine: Any, progress: Any
    ) -> batch.Summary:
        self.manifest, self.out, self.options, self.engine = manifest, out, options, engine
        progress.begin(0)
        if self.failure is not None:
            raise self.failure
        return self.answer


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    found = Asked()
    monkeypatch.setattr(batch, "run", found)
    return found


@pytest.fixture
def manifest(tmp_path: Path) -> Path:
    path = tmp_path / "pairs.csv"
    path.write_text("before,after\nold.jpg,new.jpg\n")
    return path


@pytest.mark.parametrize(
    ("failed", "words", "code", "line"),
    [
        (0, ["--fail-on-error"], 0, None),
        (1, [], 0, None),
        (1, ["--fail-on-error"], 2, "1 of 3 pairs could not be compared (--fail-on-error)"),
        (3, [], 2, "none of 3 pairs could be compared; the first: old.jpg is empty"),
    ],
)
def test_nothing_compared_is_no_success(
    manifest: Path,
    tmp_path: Path,
    asked: Asked,
    capsys: pytest.CaptureFixture[str],
    failed: int,
    words: list[str],
    code: int,
    line: str | None,
) -> None:
    error = "old.jpg is empty" if failed else None
    asked.answer = batch.Summary(pairs=3, failed=failed, regions=0, first_error=error)
    assert run(["batch", str(manifest), "-o", str(tmp_path / "out"), *words]) == code
    last = capsys.readouterr().err.splitlines()[-1:]
    assert (last == [f"error: {line}"]) == (line is not None)


def test_a_batch_says_what_was_done_and_where_it_lies(
    manifest: Path, tmp_path: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    asked.answer = batch.Summary(
        pairs=10,
        failed=2,
        reused=3,
        regions=21,
        encoded=6,
        cache_hits=4,
        first_error="old.jpg is\nempty",
    )
    out = tmp_path / "out"
    assert run(["batch", str(manifest), "-o", str(out)]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [
        "8 of 10 pairs compared, 3 of them by an earlier run; 21 changed regions",
        "photos still known from another pair: 40%",
        f"changes: {out}/changes.parquet",
        f"pairs: {out}/pairs.parquet",
    ]
    assert captured.err.splitlines()[-1] == (
        f"warning: 2 of 10 pairs could not be compared; see the column error of "
        f"{out}/pairs.parquet; the first: old.jpg is empty"
    )


def test_a_program_gets_the_summary_also_when_nothing_could_be_compared(
    manifest: Path, tmp_path: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    asked.answer = batch.Summary(pairs=3, failed=3, regions=0, first_error="old.jpg is empty")
    out = tmp_path / "out"
    assert run(["batch", str(manifest), "-o", str(out), "--json"]) == 2
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {
        "pairs": 3,
        "reused": 0,
        "failed": 3,
        "regions": 0,
        "encoded": 0,
        "cache_hits": 0,
        "first_error": "old.jpg is empty",
        "changes_table": f"{out}/changes.parquet",
        "pairs_table": f"{out}/pairs.parquet",
    }
    assert "0 of 3 pairs compared; 0 changed regions" in captured.err.splitlines()


def test_a_quiet_batch_leaves_warnings(
    manifest: Path, tmp_path: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    asked.answer = batch.Summary(pairs=3, failed=1, regions=2, first_error="old.jpg is empty")
    assert run(["batch", str(manifest), "-o", str(tmp_path / "out"), "-q"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("warning: 1 of 3 pairs could not be compared")


def test_options_reach_the_batch(manifest: Path, tmp_path: Path, asked: Asked) -> None:
    words = [
        *("--preset", "lite", "--set", "tau=0.6", "--device", "cpu", "--write", "json,coco"),
        *("--workers", "2", "--timeout", "5", "--cache-mb", "1", "--absolute-paths"),
    ]
    assert run(["batch", str(manifest), "-o", str(tmp_path / "out"), *words]) == 0
    options = asked.options
    assert (options.write, options.timeout_s, options.cache_bytes) == (("json", "coco"), 5.0, 2**20)
    assert options.absolute_paths
    assert options.detector.args == ("lite",)
    assert options.detector.keywords == {"device": "cpu", "overrides": {"tau": "0.6"}}
    assert asked.engine == batch.Local(workers=2)
    (row,) = asked.manifest.rows()
    assert (row.before, row.after) == ("old.jpg", "new.jpg")


def test_two_folders_are_compared_by_name(tmp_path: Path, asked: Asked) -> None:
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "elm.jpg").touch()
    folders = [str(tmp_path / "old"), str(tmp_path / "new")]
    assert run(["batch", *folders, "-o", str(tmp_path / "out")]) == 0
    (row,) = asked.manifest.rows()
    assert (row.id, row.before) == ("elm", f"{folders[0]}/elm.jpg")


def test_rays_options_make_a_ray_engine() -> None:
    options = {"num_gpus": 0.5, "concurrency": 4, "address": "auto"}
    assert pick_engine("ray", None, options) == Ray(num_gpus=0.5, concurrency=4, address="auto")
    nothing = dict.fromkeys(options)
    assert pick_engine("ray", None, nothing) == Ray()
    assert pick_engine("local", None, nothing) == batch.Local()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--num-gpus", "1"], "--num-gpus, --concurrency and --ray-address need --engine ray"),
        (["--engine", "ray", "--workers", "2"], "--workers is for --engine local"),
        (["--preset", "nope"], "unknown preset 'nope'"),
        (["--set", "tau"], "--set needs KEY=VALUE"),
        (["--engine", "spark"], "spark"),
        (["--workers", "0"], "workers"),
    ],
)
def test_a_wrong_option_is_one_line_and_touches_nothing(
    manifest: Path,
    tmp_path: Path,
    asked: Asked,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    message: str,
) -> None:
    assert run(["batch", str(manifest), "-o", str(tmp_path / "out"), *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ")
    assert captured.err.count("\n") == 1
    assert message in captured.err
    assert asked.manifest is None
    assert not (tmp_path / "out").exists()


def test_what_is_no_manifest_is_refused(
    manifest: Path, tmp_path: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", str(tmp_path / "out")]
    for words, message in (
        (["none.csv"], "cannot read none.csv: No such file or directory"),
        ([str(tmp_path)], "give the folder of the photos after as well"),
        ([str(manifest), str(tmp_path)], "is a file: give a manifest alone, or two folders"),
    ):
        assert run(["batch", *words, *out]) == 2
        assert message in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_refused(
    manifest: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["batch", str(manifest), "-o", str(manifest / "out")]) == 2
    assert "pairs.csv is not a folder" in capsys.readouterr().err
    assert asked.manifest is None


def test_ctrl_c_says_how_to_continue(
    manifest: Path, tmp_path: Path, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    asked.failure = KeyboardInterrupt()
    out = tmp_path / "out"
    assert run(["batch", str(manifest), "-o", str(out)]) == 130
    expected = f"warning: stopped; give the same command again to continue in {out}"
    assert expected in capsys.readouterr().err.splitlines()


def test_names_of_files_are_parsed() -> None:
    assert parse_files("all") == NAMES
    assert parse_files("none") == ()
    assert parse_files(" mask , coco,") == ("mask", "coco")
    with pytest.raises(SettingsError, match="did you mean mask"):
        parse_files("masks,none")
    with pytest.raises(SettingsError, match="--workers"):
        pick_engine("ray", 1, {})
