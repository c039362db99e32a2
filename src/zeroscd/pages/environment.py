"""Templates and assets: read once, filled with escaped values, the same bytes each time."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from zeroscd import __version__
from zeroscd.pages.viewer import svg_path


def render(template: str, **values: object) -> str:
    """Fill a template of the folder `templates`.

    Args:
        template: Its file name.
        values: What it names; text is escaped, and a missing name is an error.
    """
    return _environment().get_template(template).render(values)


@cache
def asset(name: str) -> str:
    """Return a file of the folder `assets` as text."""
    return files("zeroscd.pages").joinpath("assets", name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        loader=PackageLoader("zeroscd.pages"),
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )
    environment.globals |= {"version": __version__, "inline": _inline, "digest": _digest}
    environment.filters |= {"svg_path": svg_path, "nbsp": _nbsp, "counted": _counted}
    return environment


def _inline(name: str) -> Markup:
    """Return an asset as it is: it is ours, and holds no closing tag."""
    return Markup(asset(name))  # noqa: S704


def _digest(name: str) -> str:
    """Return what a Content-Security-Policy calls a script by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(asset(name).encode()).digest()).decode()


def _nbsp(text: str) -> str:
    """Keep a percent sign on the line of its number."""
    return text.replace(" %", "\N{NO-BREAK SPACE}%")


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
