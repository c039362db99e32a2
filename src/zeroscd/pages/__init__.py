"""The HTML pages that we make: Jinja2 templates, one style sheet, one before/after viewer.

`render(template, **values)` fills a template; everything that it is given is escaped. Each page
extends `templates/base.html`, which carries style and scripts inside itself and lets only those
scripts run. A page with its files beside it overrides the blocks `policy`, `style` and `code`:

    {% extends "base.html" %}
    {% from "viewer.html" import viewer %}
    {% set scripts = ["viewer.js"] %}{% set images = "data:" %}
    {% block main %}
    <div data-viewer-scope>
    {{ viewer(shown) }}
    <ol><li id="region-1" data-region="1">A card: chosen, it is enlarged on both photos.</ol>
    </div>
    {% endblock %}

`shown` is a `Viewer`. `assets/viewer.js` finds every viewer when the page is loaded, and
`zeroscdViewer(element)` attaches it to one that was inserted later. What carries a `data-region`
inside the nearest `data-viewer-scope` (or the viewer alone) is highlighted together when it is
pointed at, and enlarged when it is chosen.
"""

from zeroscd.pages.environment import asset, render
from zeroscd.pages.viewer import MAX_CHIPS, Ring, Shape, Viewer

__all__ = ["MAX_CHIPS", "Ring", "Shape", "Viewer", "asset", "render"]
