from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from zeroscd.errors import SettingsError
from zeroscd.weights.backend import import_transformers

if TYPE_CHECKING:
    from pathlib import Path


def test_a_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("zeroscd.extras.find_spec", lambda _: None)
    with pytest.raises(SettingsError, match=r"pip install 'zeroscd\[models\]'"):
        import_transformers()


def test_a_torchvision_that_cannot_be_imported_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("transformers", reason="needs zeroscd[models]")
    package = tmp_path / "torchvision"
    package.mkdir()
    (package / "__init__.py").write_text(
        "raise RuntimeError('operator torchvision::nms does not exist\\nmore')"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "torchvision", raising=False)
    with pytest.raises(SettingsError) as caught:
        import_transformers()
    message = str(caught.value)
    assert "operator torchvision::nms does not exist" in message
    assert "pip uninstall torchvision" in message
    assert "\n" not in message
