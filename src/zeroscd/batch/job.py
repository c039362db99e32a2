"""Run a batch: a manifest in, two tables and a folder for each pair out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from zeroscd.batch.comparer import Options
from zeroscd.batch.journal import (
    CHANGES,
    CHANGES_CSV,
    CSV_TABLES,
    OWN_FILES,
    PAIRS,
    PAIRS_CSV,
    Journal,
)
from zeroscd.batch.local import Local
from zeroscd.batch.manifest import open_manifest
from zeroscd.batch.task import Outcome
from zeroscd.batch.written import WrittenPaths
from zeroscd.errors import OutputError, ZeroscdError
from zeroscd.export.csv_table import write_csv
from zeroscd.export.files import check_wanted, file_names
from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.output import (
    check_target,
    make_folder,
    refuse_link,
    remove_parts,
    write_together,
)
from zeroscd.progress import Silent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pyarrow as pa

    from zeroscd.batch.manifest import Manifest
    from zeroscd.batch.task import Task
    from zeroscd.progress import Progress


class Engine(Protocol):
    """Compares pairs: `Local` or `zeroscd.batch.cluster.Ray`."""

    def run(self, tasks: Iterable[Task], options: Options) -> Iterator[Outcome]:
        """Yield one outcome for each task, in any order."""
        ...


@dataclass(slots=True, kw_only=True)
class Summary:
    """What a batch did.

    Attributes:
        pairs: Rows of the manifest.
        reused: Pairs that an earlier run had compared.
        failed: Rows with an error instead of a comparison.
        regions: Changed regions in all pairs.
        encoded: Photos encoded.
        cache_hits: Photos that were needed again and found in the cache.
        first_error: The first error met.
    """

    pairs: int = 0
    reused: int = 0
    failed: int = 0
    regions: int = 0
    encoded: int = 0
    cache_hits: int = 0
    first_error: str | None = None

    def count(self, outcome: Outcome) -> None:
        """Add one outcome."""
        self.reused += outcome.reused
        self.encoded += outcome.encoded
        self.cache_hits += outcome.cache_hits
        if outcome.error is not None:
            self.first_error = self.first_error or outcome.error


def run(
    manifest: str | Path | Manifest,
    out: str | Path,
    *,
    options: Options | None = None,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Compare the pairs of a manifest; write `changes.parquet`, `pairs.parquet` and pair folders.

    If `csv` is among the files that `options` want, the two tables are written as CSV, too.

    A run that was stopped or killed continues when it is started again with the same folder:
    pairs whose photos, settings and code are the same are not computed again. A pair that cannot
    be compared is a row with its error.

    Args:
        manifest: A CSV, JSONL or Parquet file with the columns before, after and maybe id, or
            what `open_manifest` and `open_folders` of `zeroscd.batch` return.
        out: Folder for the results, on a disk of this machine.
        options: Detector, files, timeout, memory; the `lite` preset if not given.
        engine: Where the pairs are compared; this process if not given.
        progress: Told of every finished pair.

    Raises:
        DatasetError: The manifest cannot be read.
        SettingsError: An unknown file is wanted.
        OutputError: The folder cannot be written.
        ZeroscdError: The detector cannot be made.
    """
    chosen, folder, listener = options or Options(), Path(out), progress or Silent()
    check_wanted(chosen.write)
    check_target(folder)
    pairs = open_manifest(manifest) if isinstance(manifest, str | Path) else manifest
    csv_tables = CSV_TABLES if "csv" in chosen.write else ()
    for name in csv_tables:
        _spare_manifest(pairs, folder / name)
    make_folder(folder)
    for name in (*OWN_FILES, *csv_tables):
        refuse_link(folder / name)
    paths = WrittenPaths(folder=folder, base=pairs.base, absolutely=chosen.absolute_paths)
    with Journal(folder) as journal:
        remove_parts(folder)
        summary = Summary(pairs=journal.begin(pairs.rows()))
        listener.begin(journal.remaining())
        tasks = journal.tasks(base=pairs.base, folder=folder, files=file_names(chosen.write))
        for outcome in (engine or Local()).run(map(paths.in_task, tasks), chosen):
            kept = _write_files(outcome, folder / outcome.name)
            journal.record(kept)
            summary.count(kept)
            listener.advance(outcome.name, reused=outcome.reused)
        _check_complete(journal)
        _write_tables(journal, paths, summary)
        if csv_tables:
            _write_csv_tables(journal, paths)
    return summary


def _spare_manifest(manifest: Manifest, table: Path) -> None:
    """Refuse to write a table in the place of the manifest that is being read."""
    source = Path(manifest.address or "")
    if manifest.address and table.exists() and source.exists() and table.samefile(source):
        message = (
            f"cannot write {table}: it is the manifest; choose another folder with -o, or leave "
            "csv out of --write"
        )
        raise OutputError(message)


def _write_files(outcome: Outcome, folder: Path) -> Outcome:
    """Write a pair's files, on disk before its outcome is recorded.

    Returns:
        The outcome; an error where the pair's folder is a link, which would lead out of the
        batch's folder, or a file.
    """
    if not outcome.files:
        return outcome
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        error = (
            f"{folder} is a {'link' if folder.is_symlink() else 'file'}, not a folder; remove it"
        )
        return Outcome(row=outcome.row, name=outcome.name, error=error)
    remove_parts(folder)
    write_together(folder, outcome.files)
    return outcome


def _check_complete(journal: Journal) -> None:
    if missing := journal.remaining():
        message = f"{missing} pairs have no outcome; give the same command again to compare them"
        raise ZeroscdError(message)


def _write_tables(journal: Journal, paths: WrittenPaths, summary: Summary) -> None:
    def counted() -> Iterator[dict[str, object]]:
        for row in journal.pair_rows():
            summary.failed += row["error"] is not None
            summary.first_error = summary.first_error or row["error"]
            yield paths.in_row(row)

    folder, (of_pairs, of_changes) = paths.folder, _schemas(journal)
    summary.regions = write_parquet(folder / CHANGES, journal.change_rows(), of_changes)
    write_parquet(folder / PAIRS, counted(), of_pairs)


def _write_csv_tables(journal: Journal, paths: WrittenPaths) -> None:
    folder, (of_pairs, of_changes) = paths.folder, _schemas(journal)
    write_csv(folder / CHANGES_CSV, journal.change_rows(), of_changes.names)
    pairs = map(paths.in_row, journal.pair_rows())
    write_csv(folder / PAIRS_CSV, pairs, of_pairs.names)


def _schemas(journal: Journal) -> tuple[pa.Schema, pa.Schema]:
    """Return the columns of the pairs' table and of the changes' table."""
    views = journal.has_views()
    return pairs_schema(views=views), changes_schema(views=views, labels=journal.has_labels())
