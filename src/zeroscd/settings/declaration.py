"""How a setting is declared: one call holds its value and everything that is said about it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

T = TypeVar("T")

KEY = "zeroscd"  # under which a dataclass field keeps what was declared


class Open:
    """Stands where the paper says nothing that could be set."""

    def __repr__(self) -> str:
        return "OPEN"


OPEN = Open()


@dataclass(frozen=True, slots=True)
class Range:
    """Which numbers a setting takes, both ends included.

    Attributes:
        low: The lowest.
        high: The highest.
        unit: What they count or are a share of; "" = a plain number.
    """

    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Declaration:
    """What is said about a setting, beside its type and value.

    Attributes:
        meaning: What it does, in one line.
        paper: What `rules=paper` sets it to; OPEN = it stays.
        threshold: It weighs evidence that is there already; all others need the photos again.
    """

    meaning: str
    paper: object
    threshold: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaf:
    """A setting in its place.

    Attributes:
        name: By which it is set.
        branch: Field of the whole tree that holds it; None = the tree itself.
        default: Its value if nobody sets it.
        declared: What is said about it.
        kind: int, float or str.
        choices: The words that it may be; () if it is no choice of words.
        within: Which numbers it takes; None if it is no number.
        takes_none: It may be left to others.
    """

    name: str
    branch: str | None
    default: object
    declared: Declaration
    kind: type
    choices: tuple[str, ...] = ()
    within: Range | None = None
    takes_none: bool = False


def setting(default: T, meaning: str, *, paper: object = OPEN, threshold: bool = False) -> T:
    """Declare a field of a dataclass of settings; `Declaration` says what the arguments are.

    It returns a dataclass field, and says that it returns the field's value, as
    `dataclasses.field` does.
    """
    declared = Declaration(meaning, paper, threshold)
    found: T = dataclasses.field(default=default, metadata={KEY: declared})
    return found


def leaves_of(tree: type, *, branch: str | None = None) -> Iterator[Leaf]:
    """Yield every setting of a tree of dataclasses, in the order of their declaration.

    Args:
        tree: Its fields are settings, or dataclasses of settings.
        branch: What the tree is called in a larger one.
    """
    hints = get_type_hints(tree, include_extras=True)
    for one in dataclasses.fields(tree):
        if KEY in one.metadata:
            yield Leaf(
                name=one.name,
                branch=branch,
                default=one.default,
                declared=one.metadata[KEY],
                **_read_type(hints[one.name]),
            )
        else:
            yield from leaves_of(hints[one.name], branch=one.name)


def _read_type(hint: Any) -> dict[str, Any]:  # noqa: ANN401 - a type annotation
    """Return what a type says of its values: Literal[...], Annotated[int, Range], X | None."""
    if get_origin(hint) is Literal:
        return {"kind": str, "choices": get_args(hint)}
    if get_origin(hint) is Annotated:
        kind, within = get_args(hint)
        return {"kind": kind, "within": within}
    if type(None) in get_args(hint):
        inner = next(part for part in get_args(hint) if part is not type(None))
        return {**_read_type(inner), "takes_none": True}
    return {"kind": hint}


def described(tree: type[T]) -> type[T]:
    """Let the docstring of a dataclass of settings list them, for `help`."""
    tree.__doc__ = "\n".join([tree.__doc__ or "", "", "Attributes:", *_lines(tree), ""])
    return tree


def _lines(tree: type) -> Iterator[str]:
    hints, branch = get_type_hints(tree), None
    for leaf in leaves_of(tree):
        if leaf.branch is not None and leaf.branch != branch:
            branch = leaf.branch
            yield f"    {branch}: {(hints[branch].__doc__ or '').partition(chr(10))[0]}"
        indent = " " * (4 if branch is None else 8)
        yield f"{indent}{leaf.name} ({facts(leaf)}): {leaf.declared.meaning}"


def facts(leaf: Leaf) -> str:
    """Say what a setting may be, what it is, what the paper says, and whether it is a threshold.

    Example:
        >>> from zeroscd.settings import LEAVES
        >>> facts(LEAVES["verify"])
        'overlap, iou or off; default iou; paper overlap; threshold'
    """
    paper = leaf.declared.paper
    said = (
        allowed_text(leaf),
        f"default {value_text(leaf.default)}",
        "" if paper is OPEN else f"paper {value_text(paper)}",
        "threshold" if leaf.declared.threshold else "",
    )
    return "; ".join(filter(None, said))


def allowed_text(leaf: Leaf) -> str:
    """Say what a setting may be: its choices, or its range with the unit; "" if that is open.

    Example:
        >>> from zeroscd.settings import LEAVES
        >>> allowed_text(LEAVES["verify"]), allowed_text(LEAVES["layer"])
        ('overlap, iou or off', '1 to 1000 or none')
    """
    if leaf.choices:
        return f"{', '.join(leaf.choices[:-1])} or {leaf.choices[-1]}"
    if leaf.within is None:
        return ""
    numbers = f"{leaf.within.low} to {leaf.within.high} {leaf.within.unit}".rstrip()
    return f"{numbers} or none" if leaf.takes_none else numbers


def value_text(value: object) -> str:
    """Write a value as it is typed.

    Example:
        >>> value_text(None), value_text(0.0), value_text(150), value_text("iou")
        ('none', '0', '150', 'iou')
    """
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return "none" if value is None else str(value)
