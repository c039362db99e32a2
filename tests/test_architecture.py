"""Imports point one way, read from the source: cli, faces, detector, models, stages, foundation."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import zeroscd
from zeroscd.fingerprint import PRESENTING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

ROOT = Path(zeroscd.__file__).parent
MAP = Path(__file__).parents[1] / "ARCHITECTURE.md"

# Later may import earlier, never the other way round; parts of one row do not import each other.
LAYERS = (
    ("arrays", "cache", "errors", "text", "renamed", "timer", "progress"),
    ("output", "extras"),
    ("ledger", "settings", "device"),
    ("images",),  # the door and the grid: the geometry that all stages share
    ("records", "segments"),
    ("weights", "image_embedding"),
    ("encoders", "alignment", "change", "segmenters", "refine", "judge", "labels"),
    ("models", "evidence", "pages"),
    ("given", "fingerprint", "export", "voting"),
    ("steps", "judging", "result", "saved"),
    ("full_size", "labelling", "tiles", "views"),
    ("detector",),
    ("retrieval", "one_call", "watch"),
    ("evaluation", "batch", "geo"),
    ("survey", "annotation"),
    ("serve", "bench", "model_check", "onnx"),
    ("cli",),
    ("__main__",),
)
LEVEL = {part: level for level, row in enumerate(LAYERS) for part in row}
HOMES = {
    "torch": {"encoders", "segmenters", "labels", "weights", "device", "bench", "onnx"},
    "transformers": {"encoders", "segmenters", "labels", "weights"},
    "lancedb": {"retrieval"},
    "rasterio": {"geo"},
    "rich": {"cli"},
    "fastapi": {"serve"},
    "typer": {"cli"},
    "jinja2": {"pages"},
}


@dataclass(frozen=True)
class Arrow:
    """One import: from which part of the package to which module, and when it happens."""

    file: str
    part: str
    target: str
    name: str
    for_types: bool
    on_call: bool

    @property
    def module(self) -> str:
        return module_name(Path(self.file))

    @property
    def target_part(self) -> str:
        return self.target.split(".")[1] if self.target.count(".") else ""


def arrows() -> Iterator[Arrow]:
    for path in sorted(ROOT.rglob("*.py")):
        file = path.relative_to(ROOT)
        part = file.parts[0].removesuffix(".py")
        yield from _walk(ast.parse(path.read_text()), str(file), part)


def _walk(
    node: ast.AST, file: str, part: str, *, for_types: bool = False, on_call: bool = False
) -> Iterator[Arrow]:
    for child in ast.iter_child_nodes(node):
        types = for_types or (
            isinstance(child, ast.If)
            and isinstance(child.test, ast.Name)
            and child.test.id == "TYPE_CHECKING"
        )
        call = on_call or isinstance(child, ast.FunctionDef)
        for target, name in _targets(child):
            yield Arrow(file, part, target, name, types, call)
        yield from _walk(child, file, part, for_types=types, on_call=call)


def _targets(node: ast.AST) -> list[tuple[str, str]]:
    if isinstance(node, ast.Import):
        return [(alias.name, "") for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        return [("." * node.level + (node.module or ""), alias.name) for alias in node.names]
    return []


def module_name(file: Path) -> str:
    parts = ("zeroscd", *file.with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


ARROWS = list(arrows())
MODULES = {module_name(path.relative_to(ROOT)) for path in ROOT.rglob("*.py")} - {"zeroscd"}
INNER = [a for a in ARROWS if a.target.startswith("zeroscd.") and a.part != "__init__"]


def test_the_arrows_were_found() -> None:
    assert len(INNER) > 100
    assert any(a.part == "steps" and a.target == "zeroscd.alignment.align" for a in INNER)


def test_every_part_of_the_package_has_its_layer() -> None:
    parts = {a.part for a in ARROWS} - {"__init__"}
    assert parts <= set(LEVEL), f"give {parts - set(LEVEL)} a place in LAYERS"


def test_the_map_of_the_house_shows_these_layers() -> None:
    text = MAP.read_text(encoding="utf-8").partition("## Who imports whom")[2]
    shown = [row.split(", ") for row in text.split("```")[1].strip().splitlines()]
    assert [set(row) for row in shown] == [set(row) for row in reversed(LAYERS)]


def test_imports_point_down() -> None:
    upwards = [
        a for a in INNER if a.part != a.target_part and LEVEL[a.target_part] >= LEVEL[a.part]
    ]
    assert upwards == []


def test_no_module_imports_itself_through_others() -> None:
    """For types or late, an import counts: who reads one file of a circle must read them all."""
    assert circle({name: imports_of(name) for name in MODULES}) == []


def test_a_circle_would_be_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == ["a", "b", "c"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def imports_of(module: str) -> set[str]:
    """Modules of the package that a module imports; what is no module is a name in one."""
    found = set()
    for a in INNER:
        if module == a.module:
            names = [a.target, f"{a.target}.{a.name}" if a.name else a.target]
            found |= {name for name in names if name in MODULES} - {module}
    return found


def circle(imports: Mapping[str, set[str]]) -> list[str]:
    """Return modules that import each other in a circle, sorted; none if there is no circle."""
    remaining = {name: set(targets) for name, targets in imports.items()}
    while free := [name for name, targets in remaining.items() if not targets & remaining.keys()]:
        for name in free:
            del remaining[name]
    imported = set().union(*remaining.values()) & remaining.keys() if remaining else set()
    return sorted(imported)


def test_only_the_foundation_is_imported_relative_to_nothing() -> None:
    assert [a for a in ARROWS if a.target.startswith("..")] == []


def test_what_lies_above_the_detector_decides_no_result() -> None:
    above = {part for part, level in LEVEL.items() if level > LEVEL["detector"]}
    folders = {path.name for path in ROOT.iterdir() if path.is_dir()} - {"__pycache__"}
    # Exports lie below, for a result can save itself; they draw what was decided.
    assert set(PRESENTING) == {*above & folders, "export", "pages", "samples"}


@pytest.mark.parametrize("library", HOMES)
def test_a_library_stays_in_its_home(library: str) -> None:
    visitors = {
        (a.file, a.target)
        for a in ARROWS
        if a.target.split(".")[0] == library and a.part not in HOMES[library]
    }
    assert visitors == set()


def test_the_front_door_imports_nothing_until_asked() -> None:
    eager = [a for a in ARROWS if a.part == "__init__" and not a.for_types]
    assert {a.target for a in eager} <= {"__future__", "importlib", "typing"}


def test_modules_and_functions_stay_small() -> None:
    too_long = []
    for path in ROOT.rglob("*.py"):
        source = path.read_text()
        lines = source.count("\n")
        if lines > 300:
            too_long.append(f"{path.relative_to(ROOT)}: {lines} lines")
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef):
                length = _length(node)
                if length > 40:
                    too_long.append(f"{path.relative_to(ROOT)}: {node.name} has {length} lines")
    assert too_long == []


def _length(function: ast.FunctionDef) -> int:
    """Lines of a function's body without its docstring; commands declare an option a line."""
    assert function.end_lineno is not None
    documented = ast.get_docstring(function) is not None
    body = function.body[1:] if documented else function.body
    return function.end_lineno - body[0].lineno + 1 if body else 0


def test_no_module_is_called_utils() -> None:
    names = {part for path in ROOT.rglob("*.py") for part in path.relative_to(ROOT).parts}
    assert not {n for n in names if "util" in n or "helper" in n or "common" in n}
