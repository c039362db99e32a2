"""Events of a drawn street that a camera passes, with the toy encoder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from zeroscd.batch import Options
from zeroscd.export.table import changes_schema, pairs_schema, write_parquet
from zeroscd.survey.events import Event, find_events

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

TOY = Path(__file__).parents[2] / "batch" / "toy.py"
BLOCK_PX, HEIGHT_PX, WIDTH_PX, STEP_PX = 8, 192, 256, 48
STEP_DEG = 8 / 111_195  # eight metres
GPS_FOLDER = 0x8825
WALL = (
    np.random.default_rng(7)
    .integers(0, 256, (HEIGHT_PX // BLOCK_PX, 80, 3), np.uint8)
    .repeat(BLOCK_PX, axis=0)
    .repeat(BLOCK_PX, axis=1)
)
SIDE_PX = 48
THING, OTHER = (160, 64), (200, 130)  # left upper corners on the wall


class Drive:
    """Photos of a long wall, each a step further on, and what a comparison found in them."""

    def __init__(self, root: Path, options: Options) -> None:
        self.root, self.options, self.out = root, options, root / "out"
        self.pairs: list[dict[str, Any]] = []
        self.changes: list[dict[str, Any]] = []
        self.out.mkdir()

    def photo(self, when: str, step: int, *, gps: bool) -> str:
        path = self.root / when / f"{step}.png"
        path.parent.mkdir(exist_ok=True)
        notes = Image.Exif()
        if gps:
            east = 11 + step * STEP_DEG
            notes[GPS_FOLDER] = {1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (east, 0.0, 0.0)}
        view = WALL[:, step * STEP_PX : step * STEP_PX + WIDTH_PX]
        Image.fromarray(view).save(path, exif=notes)
        return f"../{when}/{step}.png"

    def compare(
        self,
        step: int,
        *found: tuple[int, int],
        kind: str = "added",
        old_step: int | None = None,
        gps: bool = True,
        **values: Any,
    ) -> None:
        """Add a pair in which things were found, given by where they are on the wall."""
        name = f"p{len(self.pairs)}"
        shown_step = step if kind == "added" or old_step is None else old_step
        place = (0.0, 11 + step * STEP_DEG) if gps else (None, None)
        self.pairs.append(
            {
                "pair": name,
                "before": self.photo("old", step if old_step is None else old_step, gps=gps),
                "after": self.photo("new", step, gps=gps),
                "status": "ok",
                "taken_before": f"2020-01-01T00:00:0{step}",
                "taken_after": f"2025-01-01T00:00:0{step}",
            }
        )
        for number, (x, y) in enumerate(found, 1):
            left, right = (x - shown_step * STEP_PX + aside for aside in (0, SIDE_PX))
            ring = [[left, y], [right, y], [right, y + SIDE_PX], [left, y + SIDE_PX]]
            self.changes.append(
                {
                    "pair": name,
                    "region": number,
                    "kind": kind,
                    "score": 0.5 + step / 10,
                    "area_px": SIDE_PX**2,
                    "polygon_xy": [ring],
                    "frame": "t1" if kind == "added" else "t0",
                    "at_border": False,
                    "height": HEIGHT_PX,
                    "width": WIDTH_PX,
                    "latitude": place[0],
                    "longitude": place[1],
                    **values,
                }
            )

    def events(self, options: Options | None = None) -> list[Event]:
        write_parquet(self.out / "pairs.parquet", self.pairs, pairs_schema())
        write_parquet(self.out / "changes.parquet", self.changes, changes_schema())
        return find_events(self.out, options or self.options)


@pytest.fixture
def drive(tmp_path: Path, load_module: Callable[[str, Path], ModuleType]) -> Drive:
    toy = load_module("zeroscd_batch_toy", TOY)
    return Drive(tmp_path, Options(detector=toy.make))


@pytest.mark.parametrize("gps", [True, False])
def test_one_thing_in_three_photos_is_one_event(drive: Drive, gps: bool) -> None:  # noqa: FBT001
    for step in range(3):
        drive.compare(step, THING, gps=gps)
    (found,) = drive.events()
    assert (found.id, found.kind, found.score) == (1, "added", 0.7)
    assert (found.sightings, found.views) == (3, 3)
    assert found.photos == ("../new/0.png", "../new/1.png", "../new/2.png")
    assert found.regions == (("p0", 1), ("p1", 1), ("p2", 1))
    assert (found.best_pair, found.best_region, found.best_photo) == ("p2", 1, "../new/2.png")
    assert (found.first_seen, found.last_seen) == ("2025-01-01T00:00:00", "2025-01-01T00:00:02")
    # The wall's camera looks ahead while it moves aside, so that no bearings cross.
    assert found.position == ("camera" if gps else None)
    assert found.longitude == (pytest.approx(11 + 2 * STEP_DEG) if gps else None)


def test_two_things_are_two_events_the_more_certain_first(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(1, (240, 130), THING)  # the first photo ends at 256
    found = drive.events()
    assert [event.regions for event in found] == [(("p0", 1), ("p1", 2)), (("p1", 1),)]
    assert [(event.id, event.sightings) for event in found] == [(1, 2), (2, 1)]


def test_added_and_removed_are_never_one_event(drive: Drive) -> None:
    for kind in ("added", "removed"):
        for step in range(2):
            drive.compare(step, THING, kind=kind)
    assert [(event.kind, event.sightings) for event in drive.events()] == [
        ("added", 2),
        ("removed", 2),
    ]


def test_what_is_gone_was_last_seen_in_the_newest_old_photo(drive: Drive) -> None:
    for step in range(3):
        drive.compare(step, THING, kind="removed")
    (found,) = drive.events()
    assert found.photos == ("../old/0.png", "../old/1.png", "../old/2.png")
    assert (found.first_seen, found.last_seen) == ("2020-01-01T00:00:00", "2020-01-01T00:00:02")


def test_first_and_last_seen_are_instants_not_clocks(drive: Drive) -> None:
    days = ("2026-05-05T00:10:00+02:00", "2026-05-04T23:30:00+00:00", "2026-04-30T12:00:00+00:00")
    for step, taken in enumerate(days):
        drive.compare(step, THING)
        drive.pairs[-1]["taken_after"] = taken
    (found,) = drive.events()
    assert (found.first_seen, found.last_seen) == (days[2], days[1])


def test_pairs_that_share_an_old_photo_agree_in_its_frame(drive: Drive) -> None:
    for step in range(2):
        drive.compare(step, THING, kind="removed", old_step=1, gps=False)
    no_detector = Options(detector=lambda: pytest.fail("encoded a photo"))
    (found,) = drive.events(no_detector)
    assert found.sightings == 2
    assert found.photos == ("../old/1.png",)


def test_what_another_photo_of_the_place_does_not_show_comes_last(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(5, (THING[0] + 5 * STEP_PX, THING[1]))  # out of the first one's view
    drive.compare(6)
    certain, doubtful = drive.events()
    assert (certain.missed_by, doubtful.missed_by) == (0, 1)
    assert doubtful.score > certain.score


def test_two_photos_that_agree_outweigh_those_that_miss_it(drive: Drive) -> None:
    for step in range(4):
        found = (THING,) if step in (1, 2) else ()
        drive.compare(step, *found)
    (event,) = drive.events()
    assert (event.sightings, event.missed_by) == (2, 2)


def test_a_photo_that_shows_only_a_part_of_the_place_misses_nothing(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(4)  # 192 px on: the thing's left end is out of view
    (found,) = drive.events()
    assert found.missed_by == 0


def test_a_photo_that_was_not_aligned_with_its_old_one_misses_nothing(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(1)
    drive.pairs[-1]["not_aligned"] = "few inliers"
    (found,) = drive.events()
    assert found.missed_by == 0


def test_without_a_neighbour_nothing_is_encoded(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(9)
    assert len(drive.events(Options(detector=lambda: pytest.fail("encoded a photo")))) == 1


def test_photos_that_do_not_align_link_nothing(drive: Drive) -> None:
    drive.compare(0, THING, gps=False)
    drive.compare(5, (400, 64), gps=False)
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT_PX, WIDTH_PX, 3), np.uint8)
    Image.fromarray(noise).save(drive.root / "new" / "5.png")
    assert len(drive.events()) == 2


def test_a_photo_that_is_gone_links_nothing_and_stops_nothing(drive: Drive) -> None:
    for step in range(3):
        drive.compare(step, THING)
    (drive.root / "new" / "0.png").unlink()
    assert [event.sightings for event in drive.events()] == [2, 1]


def test_views_are_those_that_saw_the_place(drive: Drive) -> None:
    drive.compare(0, THING)
    drive.compare(1, THING)
    write_parquet(drive.out / "pairs.parquet", drive.pairs, pairs_schema())
    schema = changes_schema()
    if "seen_by" not in schema.names:
        import pyarrow as pa

        schema = schema.append(pa.field("seen_by", pa.int32()))
    rows = [{**row, "seen_by": count} for row, count in zip(drive.changes, (3, 2), strict=True)]
    write_parquet(drive.out / "changes.parquet", rows, schema)
    (found,) = find_events(drive.out, drive.options)
    assert (found.sightings, found.views) == (2, 5)


def test_events_again_are_the_same(drive: Drive) -> None:
    for step in range(3):
        drive.compare(step, THING, OTHER)
    assert drive.events() == drive.events()
