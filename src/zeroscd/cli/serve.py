"""`zeroscd serve`: a page for the browser and a REST interface for programs."""

from __future__ import annotations

import os
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import Annotated

import typer

from zeroscd.cli.console import busy, say
from zeroscd.cli.options import Device, Overrides, parse_overrides
from zeroscd.errors import SettingsError
from zeroscd.extras import require_extra


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen at; 0.0.0.0 lets other machines in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes a free one.")] = 8000,
    preset: Annotated[
        list[str] | None,
        typer.Option(help="Preset to load; may be repeated.  [default: lite]"),
    ] = None,
    api_key_env: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Environment variable with a key; may be repeated."),
    ] = None,
    state: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where jobs and their photos are kept.")
    ] = None,
    settings: Overrides = None,
    device: Device = "auto",
    root_path: Annotated[
        str,
        typer.Option(
            metavar="PREFIX",
            help="Path below which a proxy publishes the server, such as /zeroscd.",
        ),
    ] = "",
    allow_host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Host name that a proxy publishes; may be repeated."),
    ] = None,
) -> None:
    """Serve a page for the browser, and a REST interface for programs.

    Example: zeroscd serve --port 8000
    """
    require_extra("serve", by="serve")
    from zeroscd.serve.path_prefix import as_prefix
    from zeroscd.settings import preset as named

    prefix = as_prefix(root_path)
    if prefix is None:
        message = f"--root-path {root_path!r} is not a plain path; write it like /zeroscd"
        raise SettingsError(message)

    presets, overrides = preset or ["lite"], parse_overrides(settings)
    for name in presets:
        named(name).override(overrides)
    keys = read_keys(api_key_env or [])
    with busy("loading the networks"):
        from zeroscd.serve.limits import Limits
        from zeroscd.serve.run import Plan
        from zeroscd.serve.run import serve as run
    run(
        Plan(
            host=host,
            port=port,
            presets=presets,
            overrides=overrides,
            device=device,
            keys=keys,
            state=state or default_state(),
            limits=Limits(),
            root_path=prefix,
            allowed_hosts=read_hosts(allow_host or []),
        ),
        ready=lambda address: say(f"listening at {address} (Ctrl+C stops)"),
    )


def read_hosts(texts: list[str]) -> list[str]:
    """Read host names as the operator gives them.

    Raises:
        SettingsError: One is not a plain name.
    """
    from zeroscd.serve.cross_site import as_host

    hosts = []
    for text in texts:
        host = as_host(text)
        if host is None:
            message = f"--allow-host {text!r} is no plain host name; write it like city.example"
            raise SettingsError(message)
        hosts.append(host)
    return hosts


def read_keys(names: list[str]) -> list[str]:
    """Read keys from the environment, where a list of processes does not show them.

    Raises:
        SettingsError: A variable is not set or empty.
    """
    keys = []
    for name in names:
        key = os.environ.get(name, "").strip()
        if not key:
            message = f"--api-key-env {name}: no such environment variable, or it is empty; set it"
            raise SettingsError(message)
        keys.append(key)
    return keys


def default_state() -> Path:
    """Return the folder for what a server keeps, by the platform's convention."""
    from platformdirs import user_state_path

    return user_state_path("zeroscd") / "serve"
