"""The Ray engine gives the rows of the local one, also when its actors die.

Ray is not among the test packages, as it has 250 MB: `pip install '.[ray]'` runs these.
"""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

from zeroscd.batch import Options, run
from zeroscd.batch import cluster as module
from zeroscd.batch.cluster import Ray, actor_count, import_ray
from zeroscd.errors import SettingsError, WeightsError, ZeroscdError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from types import ModuleType


@pytest.fixture(scope="module")
def cluster(toy: ModuleType) -> Iterator[ModuleType]:
    """Ray with two cores, for all tests here; the toy travels to it by value."""
    pytest.importorskip("ray", reason="the extra zeroscd[ray] is not installed")
    cloudpickle: Any = pytest.importorskip("ray.cloudpickle")
    cloudpickle.register_pickle_by_value(toy)
    ray = import_ray()
    ray.init(address="local", num_cpus=2, log_to_driver=False, include_dashboard=False)
    yield ray
    ray.shutdown()


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several blocks and windows out of a few pairs."""
    monkeypatch.setattr(module, "BLOCK", 2)
    monkeypatch.setattr(module, "WINDOW", 4)


def die_once(marker: str, result: Any) -> None:
    """End the actor's process, as a lost machine does, at the first sight of one pair."""
    from pathlib import Path

    if result.after.path.endswith("3.png") and not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), 9)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Ray's own making
def test_the_rows_are_those_of_the_local_engine_also_after_a_death(
    cluster: ModuleType,
    small_blocks: None,
    street: Path,
    tmp_path: Path,
    toy: ModuleType,
    tables: Callable[[Path], Any],
    capfd: pytest.CaptureFixture[str],
) -> None:
    (street / "t0" / "1.png").write_bytes(b"broken")
    run(street / "pairs.csv", tmp_path / "local", options=Options(detector=toy.make))
    marker = str(tmp_path / "died")
    fragile = Options(detector=partial(toy.make, partial(die_once, marker)))
    summary = run(
        street / "pairs.csv", tmp_path / "ray", options=fragile, engine=Ray(concurrency=2)
    )
    assert os.path.exists(marker)  # noqa: PTH110 - it did die
    assert (summary.failed, summary.reused) == (1, 0)
    assert tables(tmp_path / "ray") == tables(tmp_path / "local")
    assert (tmp_path / "ray" / "p3" / "mask.png").exists()
    assert cluster.is_initialized()  # a connection that was there stays


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_detector_that_cannot_be_made_there_is_told_in_our_words(
    cluster: ModuleType, street: Path, tmp_path: Path, toy: ModuleType
) -> None:
    def damaged() -> Any:
        message = "the weights are damaged"
        raise WeightsError(message)

    assert cluster.is_initialized()
    with pytest.raises(WeightsError, match=r"^the weights are damaged$"):
        run(street / "pairs.csv", tmp_path, options=Options(detector=damaged), engine=Ray())


@pytest.mark.parametrize(
    ("resources", "num_gpus", "expected"),
    [
        ({"CPU": 8.0, "GPU": 2.0}, 0.5, 4),
        ({"CPU": 8.0, "GPU": 2.0}, 1.0, 2),
        ({"CPU": 8.0, "GPU": 2.0}, 0.0, 8),
        ({"CPU": 8.0}, 1.0, 1),
    ],
)
def test_there_are_as_manyactor_count_as_fit(
    resources: dict[str, float], num_gpus: float, expected: int
) -> None:
    assert actor_count(resources, num_gpus) == expected


def test_without_ray_the_extra_is_named(
    street: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    with pytest.raises(SettingsError, match=r"pip install 'zeroscd\[ray\]'"):
        run(street / "pairs.csv", tmp_path / "out", engine=Ray())


def test_a_cluster_that_is_not_there_is_told_in_one_line(
    street: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Absent:
        @staticmethod
        def is_initialized() -> bool:
            return False

        @staticmethod
        def init(**options: object) -> None:
            message = f"Could not find any running\nRay instance at {options['address']}"
            raise ConnectionError(message)

    monkeypatch.setattr(module, "import_ray", Absent)
    with pytest.raises(ZeroscdError, match=r"^cannot reach Ray at auto: Could not find any runn"):
        run(street / "pairs.csv", tmp_path / "out", engine=Ray(address="auto"))
