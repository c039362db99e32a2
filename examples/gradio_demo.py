"""The detector in Gradio, for a host that expects such an app.

pip install gradio; python examples/gradio_demo.py
"""

import gradio as gr

from zeroscd import Detector
from zeroscd.export.overlay import draw_overlay

detector = Detector.from_preset("lite")


def compare(before, after, alpha):
    """Return the photo after with outlines, and a sentence."""
    evidence = detector.compare(*detector.encode([before, after]))
    result = detector.decide(evidence, detector.settings.override({"alpha": alpha}))
    return draw_overlay(result), f"{len(result.regions)} regions changed"


photos = [gr.Image(label="Before"), gr.Image(label="After")]
alpha = gr.Slider(0, 1, 0.75, label="How much of an object must differ")
app = gr.Interface(compare, [*photos, alpha], [gr.Image(label="What changed"), gr.Text(label="")])

if __name__ == "__main__":
    app.launch()
