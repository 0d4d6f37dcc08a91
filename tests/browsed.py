"""Pages in a browser, with all that they say to the console or ask a network for."""

from __future__ import annotations

import contextlib
import shutil
from importlib.util import find_spec

import pytest

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
OPTIONS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
browsed = pytest.mark.skipif(
    not (CHROMIUM and find_spec("playwright")),
    reason="PAGES ARE NOT CLICKED: no Chromium, or no playwright, here",
)


@contextlib.contextmanager
def chromium():
    """The browser, without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield browser
        browser.close()


class Opened:
    """A page in the browser, with all that it says to the console or asks a network for."""

    def __init__(self, browser, path, width=1280, ready="body[data-ready]", first=""):
        self.tab = browser.new_page(viewport={"width": width, "height": 900})
        self.said: list[str] = []
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("request", lambda request: self.said.append(request.url))
        self.tab.add_init_script(first)
        self.tab.goto(path.as_uri())
        self.tab.wait_for_selector(ready, timeout=60_000)
        self.said.remove(path.as_uri())

    def text(self, name):
        return self.tab.locator(f"#{name}").inner_text()

    def place(self, figure, row=0, source="points"):
        """Where a point of a figure is, in the window."""
        self.tab.locator(f"#{figure}").scroll_into_view_if_needed()
        x, y = self.tab.evaluate(
            """([name, source, row]) => {
              const file = Bokeh.documents.find(d => d.get_model_by_name(name));
              const plot = file.get_model_by_name(name), view = Bokeh.index.get_one(plot);
              const data = file.get_model_by_name(source).data, frame = view.frame;
              const box = view.canvas_view.el.getBoundingClientRect();
              return [box.left + frame.x_scale.compute(data.x[row]),
                      box.top + frame.y_scale.compute(data.y[row])];
            }""",
            [figure, source, row],
        )
        return x, y

    def drag(self, start, end):
        mouse = self.tab.mouse
        mouse.move(*start)
        mouse.down()
        mouse.move(*end, steps=4)
        mouse.up()
