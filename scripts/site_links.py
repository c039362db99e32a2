"""A hook of MkDocs: links that leave docs/ lead to copies inside the site, so that none is broken.

Pages of the repository's root become pages; any other file is copied to `repository/`, as it is.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mkdocs.structure.files import File

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
ROOT_PAGES = ("ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "THIRD_PARTY.md")
COPIES = PurePosixPath("repository")
LINK = re.compile(r"(?<=\]\()([^)#\s]+)(?=[)#])")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the root's pages, and every file that a page links to outside of docs/."""
    pages = {name: ROOT / name for name in ROOT_PAGES}
    for page in [*pages.values(), *DOCS.glob("*.md")]:
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            path = linked_file(page, target)
            if path is not None and not path.is_relative_to(DOCS) and path.name not in ROOT_PAGES:
                pages[place_in_site(path)] = path
    for place, path in pages.items():
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links between files of the site."""
    source = (
        ROOT / page.file.src_uri if page.file.src_uri in ROOT_PAGES else DOCS / page.file.src_uri
    )

    def in_site(match: re.Match[str]) -> str:
        path = linked_file(source, match[0])
        return match[0] if path is None else place_in_site(path)

    return LINK.sub(in_site, markdown)


def linked_file(page: Path, target: str) -> Path | None:
    """Return the file of this repository that a page links to; None if it is an address."""
    path = (page.parent / target).resolve()
    return path if "://" not in target and path.is_file() else None


def place_in_site(path: Path) -> str:
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    return path.name if path.name in ROOT_PAGES else str(COPIES / path.relative_to(ROOT).as_posix())
