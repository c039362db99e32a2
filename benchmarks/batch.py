"""Batches of thousands of pairs: both engines, speed, memory, kills, hostile manifests.

    python benchmarks/batch.py PHOTOS WORK [STEP ...] [--pairs 2000]

PHOTOS has t0/ and t1/ with equal names. WORK gets pairs made from them and all outputs. Every step
runs `zeroscd batch` in fresh processes and writes its part of benchmarks/results/batch/NAME.json;
benchmarks/README.md describes the file. Steps: engines, scaling, large, overhead, memory, kills,
actor, hostile; all if none is named.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import json
import os
import random
import signal
import socket
import statistics
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq

from zeroscd.bench import machine
from zeroscd.output import write_json

RESULTS = Path(__file__).parent / "results" / "batch"
SMALL_WH = (128, 96)  # pixels of the photos that only the engine is tested with
# Half of what may be a change counts: the more regions, the sharper the comparison of rows.
SMALL = (
    *("--device", "cpu", "--set", "side_px=128", "--set", "min_area_px=10"),
    *("--set", "min_peak=0", "--set", "alpha=0.3", "--set", "tau_share=0.25"),
    *("--set", "judge=all"),
)
SHARED_BY = 4  # pairs that have their photo before in common
GAIN, NOISE = 0.2, 4.0  # of the perturbed photo after: +- share of light, grey levels
ALONE = {**os.environ, "OMP_NUM_THREADS": "1"}
REAL_PAIRS = 30  # at the photos' own size
LARGE_PAIRS, LARGE_WH = 60, (4000, 3000)  # of 12 megapixels, as telephones take them
ENGINES = ("local", "ray")
KILLS, KILL_PAIRS, SEED = 10, 1000, 7
MAX_MORE, MAX_DELAY_S = 60, 1.0  # a kill comes after so many more pairs, and so long after that
HOSTILE_PAIRS, CORRUPT = 100, 5  # every fifth photo after is damaged
BATCH = (sys.executable, "-c", "from zeroscd.cli.main import main; main()", "batch")
WAIT_S = 2.0  # for an address that never answers
BARE = """
import json, sys, time
from pathlib import Path
from zeroscd import Detector
detector = Detector.from_preset("lite", device="cpu")
pairs = json.loads(sys.argv[1])
detector.detect(*pairs[0])
began, used = time.perf_counter(), time.process_time()
for pair in pairs:
    detector.detect(*pair)
print(json.dumps({"wall_s": time.perf_counter() - began, "cpu_s": time.process_time() - used}))
"""
TESTS = Path(__file__).parents[1] / "tests" / "batch"
TOY = """
import sys
sys.path.insert(0, sys.argv[1])
import toy
from zeroscd.batch import Local, Options, run
options = Options(detector=toy.make, cache_bytes=2**22)
run(sys.argv[2], sys.argv[3], options=options, engine=Local(workers=1))
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """How one process went."""

    code: int
    wall_s: float
    cpu_s: float
    peak_bytes: int
    stderr: str


def _absolute(text: str) -> Path:
    """Manifests lie in WORK: a path in them must not depend on where this was started."""
    return Path(text).resolve()


def main() -> None:
    """Run the steps and keep their results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", type=_absolute)
    parser.add_argument("work", type=_absolute)
    parser.add_argument("steps", nargs="*", metavar="STEP", help=", ".join(STEPS))
    parser.add_argument("--pairs", type=int, default=2000)
    parser.add_argument("--name", default=f"cpu-{os.cpu_count()}-cores")
    options = parser.parse_args()
    bench = Bench(options.photos, options.work, options.pairs)
    out = RESULTS / f"{options.name}.json"
    for step in options.steps or STEPS:
        found = STEPS[step](bench)
        print(step, json.dumps(found, indent=1), flush=True)
        known = json.loads(out.read_text()) if out.exists() else {}
        load = round(os.getloadavg()[0], 2)
        entry = {**found, "load_average": load, "pairs_asked": options.pairs}
        write_json({**known, "schema": 1, "machine": machine(), step: entry}, out)


@dataclass(frozen=True, slots=True)
class Bench:
    """Where the photos are and how many pairs are wanted."""

    photos: Path
    work: Path
    pairs: int

    def manifest(self, count: int) -> Path:
        """Make small pairs, repeating and perturbing the photos; the same ones each time."""
        folder = self.work / "small"
        for name in ("t0", "t1"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        names = sorted(path.name for path in (self.photos / "t0").iterdir())
        rows = []
        for number in range(count):
            source = names[number // SHARED_BY % len(names)]
            before = folder / "t0" / f"{number // SHARED_BY:05}.jpg"
            after = folder / "t1" / f"{number:05}.jpg"
            if not before.exists():
                cv2.imwrite(str(before), small(self.photos / "t0" / source))
            if not after.exists():
                pixels = small(self.photos / "t1" / source)
                cv2.imwrite(str(after), perturbed(pixels, np.random.default_rng(number)))
            rows.append((before, after, f"{number:05}"))
        return write_manifest(folder / f"{count}.csv", rows)

    def real_pairs(self, count: int = REAL_PAIRS) -> list[tuple[str, str]]:
        """Return pairs at their own size, the list repeated if it is too short."""
        names = sorted(path.name for path in (self.photos / "t0").iterdir())
        chosen = itertools.islice(itertools.cycle(names), count)
        return [(str(self.photos / "t0" / n), str(self.photos / "t1" / n)) for n in chosen]

    def fresh(self, name: str) -> Path:
        """Return an output folder that does not exist yet."""
        for number in itertools.count():
            path = self.work / f"{name}-{number}"
            if not path.exists():
                return path
        raise AssertionError


def small(path: Path) -> np.ndarray:
    """Read a photo at the small size."""
    return np.asarray(cv2.resize(read(path), SMALL_WH, interpolation=cv2.INTER_AREA))


def read(path: str | Path) -> np.ndarray:
    """Read a photo."""
    pixels = cv2.imread(str(path))
    assert pixels is not None, path  # noqa: S101 - the script's own input
    return np.asarray(pixels)


def perturbed(pixels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Change the light and add noise."""
    light = pixels * rng.uniform(1 - GAIN, 1 + GAIN)
    return (light + rng.normal(0, NOISE, pixels.shape)).clip(0, 255).astype(np.uint8)


def write_manifest(path: Path, rows: list[tuple[Any, ...]]) -> Path:
    """Write rows of before, after and id."""
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("before", "after", "id"), *rows])
    return path


def batch(*words: object, env: dict[str, str] | None = None) -> Done:
    """Run `zeroscd batch` in a process of its own."""
    return measured([*BATCH, *map(str, words)], env=env)


def measured(command: list[str], *, env: dict[str, str] | None = None) -> Done:
    """Run a command and say what it took."""
    began = time.perf_counter()
    process = subprocess.Popen(  # noqa: S603 - our own commands
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env
    )
    assert process.stderr is not None  # noqa: S101 - asked for above
    stderr = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    return Done(
        code=os.waitstatus_to_exitcode(status),
        wall_s=round(time.perf_counter() - began, 2),
        cpu_s=round(usage.ru_utime + usage.ru_stime, 2),
        peak_bytes=usage.ru_maxrss * 1024,
        stderr=stderr,
    )


def tables(out: Path) -> tuple[Any, Any]:
    """Return both tables of a batch, the pairs without their seconds."""
    pairs = pq.read_table(out / "pairs.parquet").drop_columns(["seconds"])
    return pairs, pq.read_table(out / "changes.parquet")


def agree(first: Path, second: Path) -> bool:
    """Say whether two batches gave the same rows."""
    return all(a.equals(b) for a, b in zip(tables(first), tables(second), strict=True))


def count_rows(out: Path) -> dict[str, int]:
    """Count what a batch gave; distinct names must be as many as rows."""
    pairs, changes = tables(out)
    return {
        "rows": pairs.num_rows,
        "distinct_names": len(set(pairs.column("pair").to_pylist())),
        "errors": pairs.column("status").to_pylist().count("error"),
        "regions": changes.num_rows,
    }


def engines(bench: Bench) -> dict[str, Any]:
    """Compare both engines' rows on all pairs."""
    manifest = bench.manifest(bench.pairs)
    found: dict[str, Any] = {}
    outs = {}
    for engine in ENGINES:
        outs[engine] = bench.fresh(f"engines-{engine}")
        done = batch(manifest, "-o", outs[engine], "--engine", engine, *SMALL)
        found[engine] = {
            "wall_s": done.wall_s,
            "pairs_per_second": round(bench.pairs / done.wall_s, 2),
            "peak_bytes_of_driver": done.peak_bytes,
            **count_rows(outs[engine]),
        }
    found["same_rows"] = agree(outs["local"], outs["ray"])
    return found


def scaling(bench: Bench) -> dict[str, Any]:
    """Time the same pairs with 1, 2, ... workers, at the photos' own size.

    Each worker has one thread. What a pair takes of the processor is told beside the wall time: on
    a machine that others use as well it is the number to trust.
    """
    manifest = real_manifest(bench)
    found: dict[str, Any] = {}
    for workers in powers_of_two(os.cpu_count() or 1):
        out = bench.fresh(f"scaling-{workers}")
        done = batch(manifest, "-o", out, "--workers", workers, "--device", "cpu")
        found[str(workers)] = {
            "pairs_per_second": round(REAL_PAIRS / done.wall_s, 3),
            "cpu_s_per_pair": round(done.cpu_s / REAL_PAIRS, 3),
            "peak_bytes": done.peak_bytes,
            "median_pair_s": median_seconds(out),
        }
    return found


def large(bench: Bench) -> dict[str, Any]:
    """Compare photos as telephones take them: pairs per second, and peak memory."""
    folder = bench.work / "large"
    rows = []
    for number, (before, after) in enumerate(bench.real_pairs(LARGE_PAIRS)):
        paths = []
        for path in (before, after):
            enlarged = folder / f"{number:03}-{Path(path).parent.name}.jpg"
            if not enlarged.exists():
                folder.mkdir(parents=True, exist_ok=True)
                pixels = cv2.resize(read(path), LARGE_WH, interpolation=cv2.INTER_CUBIC)
                cv2.imwrite(str(enlarged), perturbed(pixels, np.random.default_rng(number)))
            paths.append(enlarged)
        rows.append((*paths, f"{number:03}"))
    out = bench.fresh("large")
    done = batch(write_manifest(bench.work / "large.csv", rows), "-o", out, "--device", "cpu")
    return {
        "pairs": len(rows),
        "size_wh": LARGE_WH,
        "wall_s": done.wall_s,
        "pairs_per_second": round(len(rows) / done.wall_s, 3),
        "cpu_s_per_pair": round(done.cpu_s / len(rows), 3),
        "peak_bytes": done.peak_bytes,
        **count_rows(out),
    }


def overhead(bench: Bench) -> dict[str, Any]:
    """Time the engine with one worker against a bare loop over `Detector.detect`, interleaved.

    Both with one thread: threads that wait for each other on a busy machine count as work.
    """
    pairs, manifest = bench.real_pairs(), real_manifest(bench)
    nothing = write_manifest(bench.work / "nothing.csv", [])
    rounds: list[dict[str, float]] = []
    for _ in range(3):
        loop = subprocess.run(  # noqa: S603 - as above
            [sys.executable, "-c", BARE, json.dumps(pairs)],
            check=True,
            capture_output=True,
            text=True,
            env=ALONE,
        )
        words = ("--workers", 1, "--device", "cpu", "--cache-mb", 0)
        start = batch(nothing, "-o", bench.fresh("overhead-nothing"), *words, env=ALONE)
        done = batch(manifest, "-o", bench.fresh("overhead"), *words, env=ALONE)
        bare = json.loads(loop.stdout)
        rounds.append(
            {
                "bare_wall_s": round(bare["wall_s"], 2),
                "bare_cpu_s": round(bare["cpu_s"], 2),
                "engine_wall_s": round(done.wall_s - start.wall_s, 2),
                "engine_cpu_s": round(done.cpu_s - start.cpu_s, 2),
            }
        )
    return {
        "pairs": REAL_PAIRS,
        "rounds": rounds,
        **{
            f"{clock}_overhead": round(
                statistics.median(r[f"engine_{clock}_s"] / r[f"bare_{clock}_s"] for r in rounds)
                - 1,
                3,
            )
            for clock in ("wall", "cpu")
        },
    }


def memory(bench: Bench) -> dict[str, Any]:
    """Measure the peak with a tenth of the pairs and with all, with a cache that fills early.

    The toy detector of the tests compares, as only the engine's own memory is asked for.
    """
    found: dict[str, Any] = {}
    for count in (bench.pairs // 10, bench.pairs):
        out = bench.fresh(f"memory-{count}")
        manifest = bench.manifest(count)
        done = measured([sys.executable, "-c", TOY, str(TESTS), str(manifest), str(out)])
        found[str(count)] = {
            "exit_code": done.code,
            "wall_s": done.wall_s,
            **count_rows(out),
            "peak_bytes": done.peak_bytes,
            "journal_bytes": (out / "journal.sqlite").stat().st_size,
            "parquet_bytes": sum(path.stat().st_size for path in out.glob("*.parquet")),
        }
    return found


def kills(bench: Bench) -> dict[str, Any]:
    """Kill each engine at ten random moments, then let it end.

    The tables and masks must be those of a quiet run of the local engine.
    """
    manifest, quiet = bench.manifest(KILL_PAIRS), bench.fresh("kills-quiet")
    batch(manifest, "-o", quiet, *SMALL)
    found: dict[str, Any] = {}
    for seed, engine in enumerate(ENGINES, SEED):
        out = bench.fresh(f"kills-{engine}")
        words = (manifest, "-o", out, "--engine", engine, *SMALL)
        dice = random.Random(seed)  # noqa: S311 - moments, no secrets
        killed = [kill_at(dice, words, out) for _ in range(KILLS)]
        found[engine] = {
            "exit_codes": [code for code, _ in killed],
            "pairs_done_when_killed": [pairs for _, pairs in killed],
            "last_exit_code": batch(*words).code,
            **count_rows(out),
            "same_rows": agree(quiet, out),
            "same_files": same_files(quiet, out),
        }
    return found


def kill_at(dice: random.Random, words: tuple[object, ...], out: Path) -> tuple[int, int]:
    """Run a batch and kill it at a random moment; return its exit code and the pairs done by then.

    The moment is told by pairs, or a slow machine would be killed before its first one.
    """
    aim, delay_s = pairs_done(out) + dice.randint(0, MAX_MORE), dice.uniform(0, MAX_DELAY_S)
    process = subprocess.Popen(  # noqa: S603 - as above
        [*BATCH, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    wait_for(process, out, aim)
    time.sleep(delay_s)
    process.kill()
    return process.wait(), pairs_done(out)


def wait_for(process: subprocess.Popen[Any], out: Path, pairs: int) -> None:
    """Wait until a batch has written so many pairs, or has ended."""
    while process.poll() is None and pairs_done(out) < pairs:
        time.sleep(0.02)


def pairs_done(out: Path) -> int:
    """Count the pairs whose files are in their place."""
    return len(list(out.glob("*/mask.png")))


def actor(bench: Bench) -> dict[str, Any]:
    """Kill a Ray actor in the middle of a run."""
    manifest = bench.manifest(KILL_PAIRS)
    quiet, out = bench.fresh("actor-quiet"), bench.fresh("actor")
    batch(manifest, "-o", quiet, *SMALL)
    words = [manifest, "-o", out, "--engine", "ray", "--concurrency", 2, *SMALL]
    process = subprocess.Popen(  # noqa: S603 - as above
        [*BATCH, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    wait_for(process, out, KILL_PAIRS // 4)
    before = pairs_done(out)
    victims = actors(process.pid)
    os.kill(victims[0], signal.SIGKILL)
    _, stderr = process.communicate()
    return {
        "actors": len(victims),
        "pairs_done_when_killed": before,
        "exit_code": process.returncode,
        "stderr_lines": len(stderr.splitlines()),
        **count_rows(out),
        "same_rows": agree(quiet, out),
        "same_files": same_files(quiet, out),
    }


def hostile(bench: Bench) -> dict[str, Any]:
    """Two bad manifests and two bad outputs; every row must come back."""
    found = {"photos": bad_photos(bench), "addresses": bad_addresses(bench)}
    occupied = bench.work / "occupied"
    occupied.write_text("a file")
    for name, out in (("below a file", occupied / "out"), ("not writable", Path("/proc/out"))):
        done = batch(bench.manifest(4), "-o", out, *SMALL)
        lines = done.stderr.replace(str(bench.work), "WORK").splitlines()
        found[name] = {"exit_code": done.code, "stderr": lines}
    return found


def bad_photos(bench: Bench) -> dict[str, Any]:
    """Missing files, damaged photos, double ids, empty cells."""
    with bench.manifest(HOSTILE_PAIRS).open() as file:
        rows = [(row["before"], row["after"], row["id"]) for row in csv.DictReader(file)]
    broken = bench.fresh("broken")
    broken.mkdir()
    bad: list[tuple[Any, ...]] = []
    for number, (before, after, name) in enumerate(rows):
        if number % CORRUPT == 0:
            content = Path(after).read_bytes()
            (broken / f"{name}.jpg").write_bytes(content[: len(content) * (number % 3) // 3])
            bad.append((before, broken / f"{name}.jpg", name))
        elif number % 10 == 1:
            bad.append((f"{before}.gone", after, name))
        elif number % 10 == 2:  # noqa: PLR2004 - one row in ten each
            bad.append((before, after, "twice"))
        elif number % 25 == 3:  # noqa: PLR2004
            bad.append((before, "", name))
        else:
            bad.append((before, after, name))
    out = bench.fresh("hostile")
    done = batch(write_manifest(broken / "m.csv", bad), "-o", out, *SMALL)
    return {"exit_code": done.code, "asked": len(bad), **count_rows(out), **reasons(out)}


def bad_addresses(bench: Bench) -> dict[str, Any]:
    """Addresses that take a connection and never answer, between good ones."""
    with bench.manifest(HOSTILE_PAIRS).open() as file:
        rows = [(row["before"], row["after"], row["id"]) for row in csv.DictReader(file)]
    with closing(socket.create_server(("127.0.0.1", 0), backlog=HOSTILE_PAIRS)) as server:
        place = f"ftp://127.0.0.1:{server.getsockname()[1]}"
        bad = [
            (f"{place}/{name}.jpg" if number % 10 == 0 else before, f"file://{after}", name)
            for number, (before, after, name) in enumerate(rows)
        ]
        out = bench.fresh("timeouts")
        manifest = write_manifest(bench.work / "timeouts.csv", bad)
        done = batch(manifest, "-o", out, "--timeout", WAIT_S, *SMALL)
    return {
        "exit_code": done.code,
        "wall_s": done.wall_s,
        "asked": len(bad),
        **count_rows(out),
        **reasons(out),
    }


def reasons(out: Path) -> dict[str, Any]:
    """Count the errors of a batch by their kind."""
    kinds = {
        "does not exist": "missing",
        "is empty": "empty",
        "damaged": "damaged",
        "manifest says no": "unsaid",
        "did not answer": "timed out",
    }
    counts: dict[str, int] = {}
    for error in tables(out)[0].column("error").to_pylist():
        if error is not None:
            kind = next((name for words, name in kinds.items() if words in error), "other")
            counts[kind] = counts.get(kind, 0) + 1
    return {"errors_by_kind": counts}


def same_files(first: Path, second: Path) -> bool:
    """Say whether the pairs' masks are the same, byte by byte."""
    masks = [
        {str(path.relative_to(out)): path.read_bytes() for path in out.glob("*/mask.png")}
        for out in (first, second)
    ]
    return masks[0] == masks[1]


def actors(driver: int) -> list[int]:
    """Find the workers that hold a detector for a driver that started its own Ray."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_text()
        except OSError:
            continue  # it ended meanwhile
        pid = int(path.parent.name)
        if words.startswith("ray::") and "MapWorker" in words and driver in ancestors(pid):
            found.append(pid)
    return sorted(found)


def ancestors(pid: int) -> list[int]:
    """Return the process that started this one, the one that started that, and so on."""
    found = []
    while pid > 1:
        status = Path(f"/proc/{pid}/stat").read_text()
        pid = int(status.rpartition(")")[2].split()[1])  # after the name: state, parent
        found.append(pid)
    return found


def real_manifest(bench: Bench) -> Path:
    """Write the pairs at their own size."""
    bench.work.mkdir(parents=True, exist_ok=True)
    return write_manifest(bench.work / "real.csv", [(*pair, "") for pair in bench.real_pairs()])


def median_seconds(out: Path) -> float:
    """Return the middle one of the pairs' own times."""
    seconds = pq.read_table(out / "pairs.parquet").column("seconds").to_pylist()
    return float(round(statistics.median(s for s in seconds if s is not None), 3))


def powers_of_two(most: int) -> list[int]:
    """Return 1, 2, 4, ... up to a number of cores."""
    return [2**n for n in range(most.bit_length()) if 2**n <= most]


STEPS = {
    "engines": engines,
    "scaling": scaling,
    "large": large,
    "overhead": overhead,
    "memory": memory,
    "kills": kills,
    "actor": actor,
    "hostile": hostile,
}

if __name__ == "__main__":
    main()
