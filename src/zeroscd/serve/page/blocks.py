"""The page in Gradio: two boxes for photos, a few controls, and the comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import gradio as gr

from zeroscd.export.page import asset
from zeroscd.serve.page.actions import HALF, Actions, PageControls, Shown
from zeroscd.serve.page.viewer import ASSETS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fastapi import FastAPI

    from zeroscd.serve.service import Service

FONTS = ("system-ui", "-apple-system", "Segoe UI", "Roboto", "Noto Sans", "sans-serif")
MAX_AREA_PX = 20_000
Update: TypeAlias = tuple[Any, Any, Any]  # of the status, the viewer and its name
# The names of the photos that were sent are known to the page's script only.
PHOTO_NAMES = "(b, a, ...rest) => [...['before', 'after'].map(window.zeroscd.photo), ...rest]"
VISITORS = 64  # events at a time; the worker's queue is the real limit
PRIVATE: dict[str, Any] = {"api_visibility": "private", "show_progress": "hidden"}


def mount(app: FastAPI, actions: Actions, service: Service) -> FastAPI:
    """Put the page under /page of an application."""
    theme = gr.themes.Default(
        primary_hue="blue", neutral_hue="stone", font=FONTS, font_mono=("ui-monospace", "monospace")
    ).set(block_info_text_color="*neutral_600", block_info_text_color_dark="*neutral_300")
    script = asset(ASSETS, "page.js").replace("$max_bytes", str(service.limits.photo_bytes))
    blocks = build(actions, service)
    blocks.queue(max_size=VISITORS, default_concurrency_limit=VISITORS)
    mounted: FastAPI = gr.mount_gradio_app(
        app,
        blocks,
        path="/page",
        theme=theme,
        # Not as `css`: Gradio would put its own class before every selector, down to the root's.
        head=f"<style>{asset(ASSETS, 'page.css')}</style><script>{script}</script>",
        footer_links=[],
        run_history=False,
        enable_monitoring=False,
        pwa=False,
        ssr_mode=False,
        mcp_server=False,
        show_error=False,
    )
    return mounted


def build(actions: Actions, service: Service) -> gr.Blocks:
    """Lay out the page."""
    blocks: gr.Blocks = gr.Blocks(title="zeroscd: what changed?", analytics_enabled=False)
    with blocks:
        gr.HTML(asset(ASSETS, "head.html"), apply_default_css=False)
        names = [gr.Textbox(visible=False), gr.Textbox(visible=False)]
        shown_name = gr.Textbox(visible=False)
        gr.HTML(asset(ASSETS, "photos.html"), elem_id="photos", apply_default_css=False)
        with gr.Row(elem_id="work"):
            with gr.Column(scale=1, min_width=280, elem_id="controls"):
                button = gr.Button("Compare", variant="primary", elem_id="compare")
                status = gr.HTML(elem_id="status", apply_default_css=False)
                controls = _controls(service)
            with gr.Column(scale=3, min_width=300, elem_id="shown"):
                viewer = gr.HTML(elem_id="viewer", apply_default_css=False)
        outputs = [status, viewer, shown_name]
        button.click(_comparing(actions), [*names, *controls], outputs, js=PHOTO_NAMES, **PRIVATE)
        gr.on(
            [control.input for control in controls[1:]],
            _deciding(actions),
            [shown_name, *controls],
            outputs,
            trigger_mode="always_last",
            **PRIVATE,
        )
        controls[0].input(
            lambda preset: _own_values(service, preset), controls[:1], controls[2:], **PRIVATE
        )
    return blocks


def _controls(service: Service) -> list[Any]:
    presets = list(service.detectors)
    frame = service.detectors[service.default_preset].settings.frame
    return [
        gr.Dropdown(
            presets,
            value=service.default_preset,
            label="Preset",
            info="Which networks look at the photos",
            visible=len(presets) > 1,
            interactive=True,
        ),
        gr.Radio(
            [("after", "t1"), ("before", "t0")],
            value=frame,
            label="Draw on the photo",
            interactive=True,
        ),
        *_sliders(*_own_values(service, service.default_preset)),
    ]


def _sliders(sensitivity: float, alpha: float, area_px: int) -> list[Any]:
    texts = (
        ("Sensitivity", "Higher finds weaker changes, and more that are none"),
        ("How much of an object must differ", "1 = all of it (alpha)"),
        ("Smallest change (pixels)", "10 000 is a square of 100 by 100"),
    )
    scales = ((100, sensitivity, 1), (1, alpha, 0.01), (MAX_AREA_PX, area_px, 50))
    return [
        gr.Slider(0, most, value, step=step, label=label, info=info, interactive=True)
        for (label, info), (most, value, step) in zip(texts, scales, strict=True)
    ]


def _own_values(service: Service, preset: str) -> tuple[float, float, int]:
    """Return sensitivity, alpha and smallest area of a preset."""
    refine = service.ask(preset, {}).settings.refine
    return HALF, refine.alpha, refine.min_area_px


def _comparing(actions: Actions) -> Any:  # noqa: ANN401 - Gradio looks at the function itself
    def compare(before: str, after: str, *controls: Any) -> Iterator[Update]:  # noqa: ANN401
        for shown in actions.compare(before, after, PageControls(*controls)):
            yield _update(shown)

    return compare


def _deciding(actions: Actions) -> Any:  # noqa: ANN401 - Gradio looks at the function itself
    def decide(name: str, *controls: Any) -> Iterator[Update]:  # noqa: ANN401
        for shown in actions.decide(name, PageControls(*controls)):
            yield _update(shown)

    return decide


def _update(shown: Shown) -> Update:
    return (
        shown.status,
        gr.skip() if shown.viewer is None else shown.viewer,
        gr.skip() if shown.name is None else shown.name,
    )
