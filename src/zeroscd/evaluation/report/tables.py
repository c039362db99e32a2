"""One table, written as plain text, Markdown or LaTeX."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

LATEX_SPECIAL = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "&": r"\&",
        "%": r"\%",
        "$": r"\$",
        "#": r"\#",
        "_": r"\_",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of text.

    Attributes:
        title: One line.
        columns: Headings.
        rows: As many cells as there are columns in each.
        strong: Numbers of the rows that are ours.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    strong: frozenset[int] = frozenset()

    @property
    def numeric(self) -> frozenset[int]:
        """Numbers of the columns that hold nothing but numbers."""
        columns = enumerate(zip(*self.rows, strict=True))
        return frozenset(at for at, cells in columns if all(map(_is_number, filter(None, cells))))

    def to_text(self) -> str:
        """Write for a terminal: aligned columns, a mark at our rows."""
        marked = [
            (("> " if number in self.strong else "  ") + row[0], *row[1:])
            for number, row in enumerate(self.rows)
        ]
        lines = [("  " + self.columns[0], *self.columns[1:]), *marked]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        body = ["  ".join(_aligned(row, widths)).rstrip() for row in lines]
        return "\n".join([self.title, *body]) + "\n"

    def to_markdown(self) -> str:
        """Write for Markdown; our rows are bold."""
        lines = [_markdown_row(self.columns), "|" + " --- |" * len(self.columns)]
        for number, row in enumerate(self.rows):
            cells = [f"**{cell}**" if cell else "" for cell in row]
            lines.append(_markdown_row(cells if number in self.strong else row))
        return f"{self.title}\n\n" + "\n".join(lines) + "\n"

    def to_latex(self) -> str:
        """Write a `tabular` that needs no package; our rows are bold."""
        columns = "l" + "r" * (len(self.columns) - 1)
        lines = [rf"% {self.title}", rf"\begin{{tabular}}{{{columns}}}", r"\hline"]
        lines += [_latex_row(self.columns), r"\hline"]
        for number, row in enumerate(self.rows):
            lines.append(_latex_row(row, strong=number in self.strong))
        return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


def number(value: float | None, *, digits: int = 3) -> str:
    """Show a number, or a dash where there is none.

    Example:
        >>> number(0.75396), number(None)
        ('0.754', '-')
    """
    return "-" if value is None else f"{value:.{digits}f}"


def _aligned(row: Sequence[str], widths: Sequence[int]) -> list[str]:
    return [
        cell.rjust(width) if _is_number(cell) else cell.ljust(width)
        for cell, width in zip(row, widths, strict=True)
    ]


def _is_number(cell: str) -> bool:
    return cell == "-" or cell.replace(".", "", 1).isdecimal()


def _markdown_row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _latex_row(cells: Sequence[str], *, strong: bool = False) -> str:
    shown = [cell.translate(LATEX_SPECIAL) for cell in cells]
    if strong:
        shown = [rf"\textbf{{{cell}}}" for cell in shown]
    return " & ".join(shown) + r" \\"
