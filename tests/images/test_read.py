import io
import os
import struct
import subprocess
import sys
import warnings
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from zeroscd.arrays import Rgb
from zeroscd.errors import ImageError
from zeroscd.images.read import PhotoLimits, read_photo

WHOLE = np.random.default_rng(3).integers(0, 256, (40, 50, 3)).astype(np.uint8)


def png_of(pixels: Rgb) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def png_header(width: int, height: int) -> bytes:
    """A PNG that promises a size and holds no pixel."""
    fields = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + fields + struct.pack(">I", zlib.crc32(fields))
    return b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IDAT" + struct.pack(">I", 0)


def refusal(source: Any, **limits: int) -> str:
    with pytest.raises(ImageError) as caught:
        read_photo(source, limits=PhotoLimits(**limits))
    message = str(caught.value)
    assert message.isprintable(), "a line break or a control character in a message"
    return message


def test_a_photo_is_the_same_from_every_source(tmp_path: Path) -> None:
    path = tmp_path / "straße.png"
    path.write_bytes(png_of(WHOLE))
    for source in (path, str(path), path.read_bytes(), Image.open(path), WHOLE):
        assert np.array_equal(read_photo(source).pixels, WHOLE)


def test_a_photo_remembers_its_path_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    path.write_bytes(png_of(WHOLE))
    assert read_photo(path).path == read_photo(str(path)).path == str(path)
    assert read_photo(path.read_bytes()).path is None
    assert read_photo(Image.open(path)).path is None
    assert read_photo(WHOLE).path is None


def test_a_misleading_file_ending_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "really-a-png.jpg"
    path.write_bytes(png_of(WHOLE))
    assert np.array_equal(read_photo(path).pixels, WHOLE)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "gone.jpg"
    assert refusal(path) == f"{path} does not exist; check the path"


def test_a_folder_is_no_photo(tmp_path: Path) -> None:
    assert refusal(tmp_path) == f"{tmp_path} is a folder; give the file of a photo"


def test_a_path_through_a_file_is_no_photo(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    assert "Not a directory" in refusal(tmp_path / "file" / "photo.jpg")


def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert "is a pipe or a device; give the file of a photo" in refusal(tmp_path / "pipe")


def test_a_file_that_may_not_be_read_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "secret.png"
    path.write_bytes(png_of(WHOLE))

    def forbidden(*_args: object) -> None:  # whoever runs the tests as root may read everything
        raise PermissionError

    monkeypatch.setattr(Path, "open", forbidden)
    assert refusal(path) == f"{path} may not be read; change its permissions"


@pytest.mark.parametrize("name", ["line\nbreak.jpg", "bell\a.jpg", "turn\u202eround.jpg", ""])
def test_a_strange_file_name_does_not_break_the_line(tmp_path: Path, name: str) -> None:
    path = f"{tmp_path}/{name}" if name else ""
    assert repr(path) in refusal(path)


@pytest.mark.parametrize("name", ["null\0.jpg", "long" * 2000])
def test_a_name_that_no_file_can_have_is_refused(name: str) -> None:
    assert "cannot be read" in refusal(name)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", r"is empty \(0 bytes\); copy or download it again"),
        (b"hello, not a photo", "is not a photo that can be read here; convert it"),
        (bytes(5000), "is not a photo that can be read here; convert it"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 99 99\n", "is not a photo"),
        (png_header(40, 40), "is damaged or cut short; copy it again"),
        (png_of(WHOLE)[:-500], "is damaged or cut short; copy it again"),
    ],
)
def test_a_useless_file_is_named_with_what_is_wrong(
    tmp_path: Path, content: bytes, complaint: str
) -> None:
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    message = refusal(path)
    assert message.startswith(str(path))
    with pytest.raises(ImageError, match=complaint):
        read_photo(path)


@pytest.mark.parametrize("source", [None, 3, ["a.jpg"], io.BytesIO(), Image])
def test_anything_else_is_no_source(source: Any) -> None:
    assert "give a path, bytes or an array" in refusal(source)


def test_size_is_judged_by_the_header_before_a_pixel_is_decoded() -> None:
    # No pixels follow these headers: decoding would complain of damage instead.
    assert "has 10000 x 10000 pixels; make it smaller than 89 megapixels" in refusal(
        png_header(10_000, 10_000)
    )
    assert "claims a size that no photo has" in refusal(png_header(60_000, 60_000))
    assert "is damaged" in refusal(png_header(9_000, 9_000))


def test_limits_are_the_callers_to_set(tmp_path: Path) -> None:
    data = png_of(WHOLE)
    path = tmp_path / "photo.png"
    path.write_bytes(data)
    assert np.array_equal(
        read_photo(path, limits=PhotoLimits(max_pixels=2000, max_file_bytes=len(data))).pixels,
        WHOLE,
    )
    assert "has 50 x 40 pixels" in refusal(path, max_pixels=1999)
    assert "has 50 x 40 pixels" in refusal(WHOLE, max_pixels=1999)
    assert "has 50 x 40 pixels" in refusal(Image.fromarray(WHOLE), max_pixels=1999)
    assert "is larger than 0 megabytes" in refusal(path, max_file_bytes=len(data) - 1)
    assert "is larger than 0 megabytes" in refusal(data, max_file_bytes=len(data) - 1)


def test_a_photo_smaller_than_one_patch_is_refused() -> None:
    assert read_photo(WHOLE[:32, :32]).size_hw == (32, 32)
    assert "has 50 x 31 pixels; give a photo of at least 32 x 32" in refusal(WHOLE[:31])
    assert "has 31 x 40 pixels" in refusal(png_of(WHOLE[:, :31]))


def test_a_photo_cut_short_is_refused_or_complete(small_pictures: dict[str, bytes]) -> None:
    refused = 0
    for name, data in small_pictures.items():
        whole = read_photo(data).pixels
        for length in {*range(0, len(data), max(len(data) // 40, 1)), len(data) - 1}:
            try:
                pixels = read_photo(data[:length]).pixels
            except ImageError:
                refused += 1
            else:  # what is missing was not part of the picture: a second frame, a thumbnail
                assert np.array_equal(pixels, whole), f"{name} cut to {length} of {len(data)} bytes"
    assert refused > 20 * len(small_pictures)


def test_damage_is_told_once_by_the_error_and_by_nobody_else(
    small_pictures: dict[str, bytes], tmp_path: Path
) -> None:
    striped = small_pictures["tiff-tiff_adobe_deflate"]
    samples_per_pixel = struct.pack("<HHI", 277, 3, 1)
    (tmp_path / "libtiff.tif").write_bytes(striped[:100] + b"\xff" * 9 + striped[109:])
    (tmp_path / "log.tif").write_bytes(
        striped.replace(samples_per_pixel + b"\3", samples_per_pixel + b"\xff")
    )
    (tmp_path / "warning.gif").write_bytes(small_pictures["webp"][:30])
    # In a process of its own: pytest would catch what is logged or warned.
    program = f"""if True:
        from pathlib import Path
        from zeroscd.images.read import ImageError, read_photo
        import os
        for name in ("libtiff.tif", "log.tif", "warning.gif"):
            try:
                read_photo(Path({str(tmp_path)!r}) / name)
            except ImageError:
                os.write(2, b"refused ")
        """
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert (ran.stdout, ran.stderr) == (b"", b"refused refused refused ")


def test_a_process_without_an_error_stream_reads_tiffs(
    small_pictures: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(_descriptor: int) -> int:
        raise OSError

    monkeypatch.setattr(os, "dup", closed)
    assert read_photo(small_pictures["tiff-raw"]).size_hw == (40, 36)


def test_reading_leaves_no_file_open(small_pictures: dict[str, bytes], tmp_path: Path) -> None:
    def next_descriptor() -> int:
        probe = os.dup(2)
        os.close(probe)
        return probe

    free = next_descriptor()
    for name, picture in small_pictures.items():
        (tmp_path / name).write_bytes(picture)
        read_photo(tmp_path / name)
    assert next_descriptor() == free


def test_threads_may_read_at_once_and_leave_warnings_as_they_were(
    small_pictures: dict[str, bytes],
) -> None:
    filters = list(warnings.filters)
    names = [*small_pictures] * 5
    with ThreadPoolExecutor(8) as pool:
        photos = list(pool.map(lambda name: read_photo(small_pictures[name]).pixels, names))
    for name, pixels in zip(names, photos, strict=True):
        assert np.array_equal(pixels, read_photo(small_pictures[name]).pixels), name
    assert list(warnings.filters) == filters


edits = st.lists(
    st.tuples(
        st.floats(0, 1),  # where, as a share of the file
        st.integers(0, 12),  # bytes taken out
        st.binary(max_size=12),  # bytes put in
    ),
    min_size=1,
    max_size=6,
)


@settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_pictures_give_a_photo_or_our_own_error(
    fuzz_images: ModuleType, small_pictures: dict[str, bytes], data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from(sorted(small_pictures)))
    picture = small_pictures[name]
    for place, taken, put in data.draw(edits):
        at = int(place * len(picture))
        picture = picture[:at] + put + picture[at + taken :]
    if data.draw(st.booleans()):
        picture = fuzz_images.with_checksums(picture)
    fuzz_images.outcome(picture, fuzz_images.SMALL)  # raises whatever is not an ImageError


@settings(max_examples=100, deadline=None)
@given(
    start=st.sampled_from([b"", b"\xff\xd8\xff", b"GIF89a", b"II*\0", b"MM\0*", b"BM", b"P6 "]),
    rest=st.binary(max_size=300),
)
def test_bytes_that_only_start_like_a_picture_give_our_own_error(start: bytes, rest: bytes) -> None:
    assert refusal(start + rest).startswith("the photo given as bytes")


def test_the_fuzzing_script_counts_every_input(fuzz_images: ModuleType) -> None:
    found = fuzz_images.fuzz(runs=300, seed=5)
    assert sum(found.values()) == 300
    assert found["read as a photo"] > 10
    assert found["OSError"] > 10
