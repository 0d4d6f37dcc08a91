"""Reports in a browser: tables that sort and scroll, shapes with and without WebGL."""

from __future__ import annotations

import pytest
from browsed import Opened, browsed, chromium
from explored import brake_map

from squealstudy.engine.report import report
from squealstudy.engine.report_pictures import figure_of

pytestmark = browsed
WIDTHS = (400, 1280, 1920)
NO_WEBGL = "HTMLCanvasElement.prototype.getContext = () => null"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report([brake_map()], shapes=False), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.mark.parametrize("width", WIDTHS)
def test_a_report_fits_its_window_and_its_tables_scroll(browser, page, width):
    opened = Opened(browser, page, width, "h1")
    opened.tab.locator("summary", has_text="modes (210 rows").click()
    assert opened.tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
    scrolls = """() => {
      const table = [...document.querySelectorAll(".wide")].at(-2);
      table.scrollLeft = 99;
      return [table.scrollWidth > table.clientWidth, table.scrollLeft, table.tabIndex];
    }"""
    narrowest = opened.tab.evaluate(
        "Math.min(...[...document.querySelectorAll('figure img')].map(i => i.clientWidth))"
    )
    assert narrowest >= 700  # letters of 9 points of a picture of 9 inches are then 10 px
    if width == 400:
        figure = opened.tab.locator("figure").first
        assert figure.evaluate("f => (f.scrollLeft = 99, f.scrollLeft)") == 99
        assert figure.locator("figcaption").bounding_box()["width"] <= 400
    assert opened.tab.evaluate(scrolls) == ([True, 99, 0] if width == 400 else [False, 0, 0])
    assert opened.said == []
    opened.tab.close()


def test_a_table_is_sorted_by_the_keyboard(browser, page):
    opened = Opened(browser, page, ready="h1")
    opened.tab.locator("summary", has_text="points (35 rows").click()
    table = opened.tab.locator("details", has_text="points (35 rows")
    pressures = table.locator("td:nth-child(6)")
    before = pressures.all_inner_texts()
    table.get_by_role("button", name="pressure").focus()
    for order in ("ascending", "descending"):
        opened.tab.keyboard.press("Enter")
        numbers = [float(text) for text in pressures.all_inner_texts()]
        assert numbers == sorted(numbers, reverse=order == "descending")
        assert table.locator(f"th[aria-sort={order}]").inner_text().strip().startswith("pressure")
    assert before != pressures.all_inner_texts()
    assert opened.said == []
    opened.tab.close()


@pytest.mark.full_size  # a browser of its own
def test_without_webgl_a_sentence_stands_for_the_moving_shape(browser, page, tmp_path):
    moving = '<iframe class="moving" title="T1" srcdoc="<p>moves</p>"></iframe>'
    whole = page.read_text(encoding="utf-8")
    path = tmp_path / "shape.html"
    path.write_text(whole.replace("<h2>", moving + figure_of("", "T1", "T1") + "<h2>", 1))
    opened = Opened(browser, path, ready="h1", first=NO_WEBGL)
    assert "does not move here. It stands below." in opened.tab.locator("body").inner_text()
    assert opened.tab.locator("iframe").count() == 0
    assert opened.tab.locator('img[alt="T1"]').count() == 1
    assert opened.said == []
    opened.tab.close()
