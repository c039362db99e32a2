"""Names and values as they stand in a message of one line."""

LONGEST_SHOWN = 80  # characters of a refused value that a message repeats


def one_line(path: str) -> str:
    """Name a path so that no line break, control or invisible character of it gets through."""
    return path if path and path.isprintable() else repr(path)


def is_text(name: str) -> bool:
    r"""Tell whether a name can be stored as UTF-8; file names out of old archives cannot.

    Example:
        >>> is_text("café"), is_text("caf\udce9")
        (True, False)
    """
    return not any("\ud800" <= c <= "\udfff" for c in name)


def shown(value: object) -> str:
    """Write a refused value into a message of one line; a long one is cut.

    Example:
        >>> shown("high"), shown("a" * 1000)[-5:]
        ("'high'", 'aa...')
    """
    try:
        text = repr(value)
    except ValueError:  # Python writes no integer above some thousand digits
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."
