"""What the README tells people to type exists, and the machine that tests us types the same."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer

import zeroscd
from zeroscd.cli.main import app
from zeroscd.settings import PRESETS, leaf_names

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted(
    [*ROOT.glob("[A-Z]*.md"), *ROOT.glob("docs/*.md"), ROOT / "benchmarks" / "README.md"]
)
TEST_COMMAND = "pip install '.[test]' && pytest"


def commands(text: str) -> list[str]:
    """The zeroscd commands of a page's shell blocks and tables, without comments."""
    blocks = re.findall(r"```bash\n(.*?)```", text, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    lines += re.findall(r"\| `(zeroscd [^`]*)` \|", text)
    return [line.partition("#")[0].strip() for line in lines if line.startswith("zeroscd ")]


def test_the_readme_and_the_automatic_check_use_the_same_test_command() -> None:
    assert TEST_COMMAND in README
    assert TEST_COMMAND in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_automatic_check_and_the_contributors_page_agree_on_the_time() -> None:
    check = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    page = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split())
    (limit,) = re.findall(r"^LIMIT=(\d+) # seconds", check, re.MULTILINE)
    assert int(limit) <= 20 * 60, "with format, lint and types it must end within half an hour"
    assert f"installing and testing after {int(limit) // 60} minutes" in page
    assert f"the {int(limit) // 60} minutes of `.ci/run`" in page


def test_the_readme_begins_with_the_two_commands_that_must_work() -> None:
    assert "pip install . && zeroscd demo" in README


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_on_a_page_exists_with_its_options(page: Path) -> None:
    root = typer.main.get_command(app)
    for line in commands(page.read_text(encoding="utf-8")):
        words = shlex.split(line)[1:]
        command = root
        while words and words[0] in getattr(command, "commands", {}):
            command = command.commands[words.pop(0)]  # type: ignore[attr-defined]
        assert command is not root, f"no such command: {line}"
        known = {option for parameter in command.params for option in parameter.opts}
        options = {word for word in words if word.startswith("-")}
        assert options <= known, line
        for setting in (word for at, word in enumerate(words) if words[at - 1] == "--set"):
            assert setting.partition("=")[0] in leaf_names(), line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_inside_the_project_leads_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} points to {target}"


def test_every_page_of_the_docs_has_its_place_in_the_site() -> None:
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    listed = re.findall(r": (\S+\.md)$", nav, re.MULTILINE)
    assert {path.name for path in ROOT.glob("docs/*.md")} <= set(listed)
    assert len(listed) == len(set(listed))


def test_what_is_published_nowhere_is_installed_from_the_clone() -> None:
    for page in PAGES:
        named = re.findall(r"pip install (?:-\S+ )*'?zeroscd", page.read_text(encoding="utf-8"))
        assert named == [], page.name


def test_the_version_is_the_same_wherever_it_is_written() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (\S+)$", citation, re.MULTILINE) == [project["version"]]
    assert zeroscd.__version__ == project["version"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\n## {project['version']} - " in changes


def test_the_readme_names_every_preset() -> None:
    for name in PRESETS:
        assert f"`{name}`" in README


def test_documents_name_settings_that_exist() -> None:
    text = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert len(rows) > 10
    assert set(rows) <= set(leaf_names())


def test_the_map_of_the_house_names_every_part_and_no_other() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    package = ROOT / "src" / "zeroscd"
    parts = {path.name for path in package.glob("*.py")}
    parts |= {path.name + "/" for path in package.iterdir() if path.is_dir()} - {"__pycache__/"}
    assert set(re.findall(r"^  (\S+) ", text.split("```")[1], re.MULTILINE)) == parts
