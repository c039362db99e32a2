"""What the pages that we write share: their own files, and a script that only they can run."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files


@cache
def asset(part: str, name: str) -> str:
    """Return a file of a part's folder `assets` as text.

    Args:
        part: Folder of the package, such as "export" or "serve/page".
        name: Of the file.
    """
    return files("zeroscd").joinpath(part, "assets", name).read_text(encoding="utf-8")


def code(style: str, script: str) -> dict[str, str]:
    """Return style, script and the script's digest for a template that stands alone.

    Only the script of this digest may run in the page, whatever a file name holds.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return {"style": style, "script": script, "script_sha256": digest}
