"""The report in a real browser, driven as a reader would."""

import io
import time
from dataclasses import dataclass, field

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from flyrl.evaluation.drive_map import DriveMap
from flyrl.report import Video, write_report
from flyrl.report.video import FPS, HOLD_FRAMES, encode
from tests.chromium import chromium
from tests.report.hostile import HOSTILE, hostile_results
from tests.report.test_close_up import walked
from tests.synthetic import make_results

NAMES = ("target-ppo", "cpg", "hybrid")
TERRAINS = ("flat", "gapped")
WIDE, NARROW = {"width": 1200, "height": 900}, {"width": 400, "height": 800}


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


FILMED = 20
"""Pictures of an episode's film, before its end stands still."""

DARKEST, BRIGHTER = 40, 8


def film(name, terrain):
    """A video whose pictures get brighter one by one, until its end."""
    pictures = [
        np.full((48, 64, 3), DARKEST + BRIGHTER * min(number, FILMED - 1), np.uint8)
        for number in range(FILMED + HOLD_FRAMES)
    ]
    poster = io.BytesIO()
    Image.fromarray(pictures[-1]).save(poster, "JPEG")
    return Video(
        controller=name,
        terrain=terrain,
        episode=0,
        outcome="timeout",
        num_frames=len(pictures),
        frame_s=0.01,
        mp4=encode(pictures),
        poster=poster.getvalue(),
    )


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A report with all that one can have."""
    drives = np.linspace(-0.5, 1.5, 3)
    left, right = np.meshgrid(drives, drives, indexing="ij")
    return write_report(
        make_results(NAMES, TERRAINS, episodes=5),
        tmp_path_factory.mktemp("report"),
        videos=[film(name, "flat") for name in NAMES],
        examples=[walked("cpg")],
        drive_map=DriveMap(drives, left + right, right - left),
    )


@dataclass
class Heard:
    """What a page said that it should not have, and all that it asked for."""

    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def listen(self, page):
        page.on("console", self._console)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))

    def _console(self, message):
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)


@pytest.fixture
def visit(browser, report):
    """Opens the report, or another page, as a reader with such a screen has it: `visit(**options)`.

    Options are those of a browser context. No page may complain during a test, or ask for anything
    from elsewhere.
    """
    contexts, heard = [], Heard()

    def open_page(path=report, **options):
        contexts.append(browser.new_context(**{"viewport": WIDE, "offline": True, **options}))
        page = contexts[-1].new_page()
        heard.listen(page)
        page.goto(path.as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert heard.complaints == []
    elsewhere = [url for url in heard.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert elsewhere == []


def wait_until(page, script, argument=None):
    """Wait until a script is true; how Playwright itself waits, the page's policy forbids."""
    end = time.monotonic() + 30.0
    while not page.evaluate(script, argument):
        assert time.monotonic() < end, f"never so: {script}"
        page.wait_for_timeout(20)


def column(page, table, heading):
    """What a table shows below a heading, row by row, as it sorts by."""
    return page.eval_on_selector(
        table,
        """(table, heading) => {
            const headings = [...table.tHead.rows[0].cells].map((cell) => cell.innerText);
            const column = headings.findIndex((text) => text.startsWith(heading));
            return [...table.tBodies[0].rows].map(
                (row) => row.cells[column].dataset.value ?? row.cells[column].innerText);
        }""",
        heading,
    )


def luminance(colour):
    """Relative luminance of a colour as `rgb(0, 0, 0)` (WCAG 2)."""
    channels = np.array([float(part) for part in colour.strip("rgba()").split(",")[:3]]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    light, dark = sorted([luminance(one), luminance(other)], reverse=True)
    return (light + 0.05) / (dark + 0.05)


def style(page, selector, key):
    return page.eval_on_selector(selector, "(one, key) => getComputedStyle(one)[key]", key)


def test_contrast_is_that_of_wcag():
    assert contrast("rgb(0, 0, 0)", "rgb(255, 255, 255)") == pytest.approx(21)
    assert contrast("rgb(119, 119, 119)", "rgb(255, 255, 255)") == pytest.approx(4.48, abs=0.01)


def test_a_page_that_complains_is_heard(browser, tmp_path):
    bad = tmp_path / "bad.html"
    bad.write_text("<script>console.warn('one'); missing()</script><img src='http://a.invalid/b'>")
    heard, context = Heard(), browser.new_context(offline=True)
    page = context.new_page()
    heard.listen(page)
    page.goto(bad.as_uri())
    context.close()
    assert "one" in heard.complaints
    assert "missing is not defined" in heard.complaints
    assert "http://a.invalid/b" in heard.requests


def test_it_opens_offline_without_a_word(visit):
    page = visit()
    assert page.title() == "target on flat, gapped · flyrl report"
    expect(page.locator("h1")).to_be_visible()
    # visit() checks that nothing was said


def test_a_click_on_a_heading_sorts_and_another_turns_it_round(visit):
    page = visit()
    heading = page.locator("table.rates th", has_text="speed")
    heading.locator("button").click()
    down = [float(value) for value in column(page, "table.rates", "speed")]
    assert down == sorted(down, reverse=True)
    assert heading.get_attribute("aria-sort") == "descending"
    heading.locator("button").click()
    up = [float(value) for value in column(page, "table.rates", "speed")]
    assert up == sorted(down) != down
    assert heading.get_attribute("aria-sort") == "ascending"


def test_missing_values_stand_last_either_way(visit):
    page = visit()
    for _ in range(2):
        page.locator("table.rates th", has_text="time to goal").locator("button").click()
        values = column(page, "table.rates", "time to goal")
        missing = [value == "" for value in values]
        assert any(missing)
        assert missing == sorted(missing)


def test_every_link_of_the_navigation_shows_its_page_alone(visit):
    page = visit()
    links = page.locator("nav a").all()
    assert len(links) == 4 + len(TERRAINS)
    for link in links:
        link.click()
        expect(page.locator(link.get_attribute("href"))).to_be_visible()
        shown = [each for each in page.locator("main > .page").all() if each.is_visible()]
        assert ["#" + each.get_attribute("id") for each in shown] == [link.get_attribute("href")]
        assert link.get_attribute("aria-current") == "page"


def test_a_link_from_the_summary_leads_to_the_page_of_a_terrain(visit):
    page = visit()
    page.locator("#leaders a", has_text="gapped").click()
    expect(page.locator("#gapped h2")).to_be_visible()
    page.go_back()
    expect(page.locator("#leaders")).to_be_visible()


def test_a_section_of_a_page_can_be_addressed(visit, report):
    page = visit()
    page.goto(f"{report.as_uri()}#provenance")
    expect(page.locator("#provenance")).to_be_visible()
    expect(page.locator("#summary")).to_be_hidden()


def test_the_navigation_stays_in_sight_and_leads_to_the_top_of_a_page(visit):
    page = visit(reduced_motion="reduce")
    page.locator("nav a", has_text="Flat").click()
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    page.locator("nav a", has_text="Gapped").click(no_wait_after=True)
    top = page.locator("#gapped h2").bounding_box()["y"]
    bar = page.locator(".pages").bounding_box()
    assert bar["y"] == pytest.approx(0, abs=1)
    assert bar["height"] <= top < WIDE["height"] / 2


def test_nothing_is_wider_than_a_phone(visit):
    page = visit(viewport=NARROW)
    assert page.evaluate("document.documentElement.scrollWidth") == NARROW["width"]


@pytest.mark.parametrize("width", [1280, 800, 400])
def test_no_column_is_cut_without_a_sign(visit, width):
    page = visit(viewport={"width": width, "height": 900})
    for link in page.locator("nav a").all():
        link.click()
        if link.get_attribute("href") == "#episodes":
            rows_shown(page)
        cut = page.evaluate(
            """() => [...document.querySelectorAll("body *:not(svg *)")].filter((one) => {
                const box = one.getBoundingClientRect();
                let scroller = one;
                while (scroller && getComputedStyle(scroller).overflowX === "visible") {
                    scroller = scroller.parentElement;
                }
                const isSigned = scroller && getComputedStyle(scroller).overflowX === "auto"
                    && getComputedStyle(scroller).backgroundImage.includes("gradient");
                const end = scroller?.getBoundingClientRect().right ?? innerWidth;
                return box.width > 0 && box.right > end + 1 && !isSigned;
            }).map((one) => one.outerHTML.slice(0, 80))"""
        )
        assert cut == []
        scrolled = page.evaluate(
            """() => [...document.querySelectorAll(".page:not([hidden]) :has(table)")]
                .filter((one) => one.scrollWidth > one.clientWidth + 1)
                .map((one) => one.className + one.querySelector("table").id)"""
        )
        assert width < 1280 or scrolled == []


def test_text_is_readable_by_day_and_by_night(visit):
    page = visit()
    parts = dict.fromkeys(["h1", ".headline", ".caption", "nav a", ".rates td", "code"], "color")
    parts["svg text"] = "fill"
    grounds = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        grounds.append(style(page, "html", "backgroundColor"))
        for part, key in parts.items():
            assert contrast(style(page, part, key), grounds[-1]) >= 4.5, part
    assert luminance(grounds[0]) > 0.8
    assert luminance(grounds[1]) < 0.1


def test_paper_has_no_controls_and_is_white(visit):
    page = visit(color_scheme="dark")
    page.locator("nav a", has_text="Flat").click()
    controls = page.locator("nav, #flat .clock")
    expect(controls.last).to_be_visible()
    assert all(control.is_visible() for control in controls.all())
    page.emulate_media(media="print")
    assert not any(control.is_visible() for control in controls.all())
    assert style(page, "html", "backgroundColor") == "rgb(255, 255, 255)"
    assert all(each.is_visible() for each in page.locator("main > .page").all())


def on_flat(page):
    page.locator("nav a", has_text="Flat").click()
    return page.locator("#flat .player").first


def times(page):
    return page.eval_on_selector_all("#flat video", "videos => videos.map((v) => v.currentTime)")


def test_videos_play_together(visit):
    page = visit()
    on_flat(page).get_by_role("button", name="Play").click()
    wait_until(
        page,
        """(count) => {
            const videos = [...document.querySelectorAll("#flat video")];
            return videos.length === count && videos.every((video) => video.currentTime > 0);
        }""",
        len(NAMES),
    )


def test_videos_stand_still_once_their_page_is_left(visit):
    page = visit()
    on_flat(page)
    are_paused, button, frame, last = page.evaluate(
        """async () => {
            const [button, slider] = document.querySelector("#flat .clock").children;
            const videos = [...document.querySelectorAll("#flat video")];
            const frames = () => new Promise(requestAnimationFrame);
            button.click();
            while (!videos.every((video) => !video.paused && video.currentTime > 0)) await frames();
            location.hash = "gapped";
            while (!document.getElementById("flat").hidden) await frames();
            await frames();
            const arePaused = videos.every((video) => video.paused);
            return [arePaused, button.textContent, Number(slider.value), Number(slider.max)];
        }"""
    )
    assert are_paused
    assert button == "Play"
    assert frame < last  # else they would have stopped anyway


def test_the_slider_moves_all_videos_and_the_line_in_the_curves(visit):
    page = visit()
    player = on_flat(page)
    slider = player.get_by_role("slider")
    slider.focus()
    slider.press("Home")
    places = []
    for _ in range(2):
        for _ in range(3):
            slider.press("ArrowRight")
        frame = int(slider.input_value())
        wait_until(
            page,
            """(time) => [...document.querySelectorAll("#flat video")].every(
                (video) => Math.abs(video.currentTime - time) < 0.021)""",
            (frame + 0.5) / FPS,
        )
        places.append(player.locator(".run-along .cursor").first.bounding_box()["x"])
    assert frame == 6
    assert places[0] < places[1]


def shown_number(page):
    """Number of the picture that the first video shows, by its brightness."""
    wait_until(
        page,
        """() => [...document.querySelectorAll("#flat video")].every((video) => !video.seeking)""",
    )
    page.wait_for_timeout(100)  # until it is painted
    picture = Image.open(io.BytesIO(page.locator("#flat video").first.screenshot())).convert("L")
    level = picture.getpixel((picture.width // 2, picture.height // 2))
    return round((level - DARKEST) / BRIGHTER)


def told_number(page):
    """Number of the picture of the time that the slider tells."""
    return round(float(page.locator("#flat .clock output").inner_text().split()[0]) / 0.01)


def test_the_time_told_is_that_of_the_picture(visit):
    page = visit(reduced_motion="reduce")
    player = on_flat(page)
    assert told_number(page) == shown_number(page) == FILMED - 1  # the posters
    player.get_by_role("button", name="Play").click()
    wait_until(
        page,
        """() => {
            const {value} = document.querySelector("#flat .clock input");
            return 3 < value && value < 12;
        }""",
    )
    player.get_by_role("button", name="Pause").click()
    assert told_number(page) == shown_number(page)
    slider = player.get_by_role("slider")
    slider.focus()
    slider.press("Home")
    for number in range(3):
        assert told_number(page) == shown_number(page) == number
        slider.press("ArrowRight")
    slider.press("End")
    assert told_number(page) == shown_number(page) == FILMED - 1


def test_a_click_in_the_curves_moves_the_slider(visit):
    page = visit(reduced_motion="reduce")
    player = on_flat(page)
    player.locator(".run-along svg").scroll_into_view_if_needed()
    box = player.locator(".run-along svg").bounding_box()
    page.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    assert int(player.get_by_role("slider").input_value()) > 0


def rows_shown(page):
    page.locator("#rows tbody tr").first.wait_for()
    return [row.split("\t") for row in page.locator("#rows tbody tr").all_inner_texts()]


def test_a_dot_leads_to_what_everybody_did_in_its_episode(visit):
    page = visit(reduced_motion="reduce")
    page.locator("nav a", has_text="Gapped").click()
    page.locator("#gapped").wait_for()
    # one that no other lies upon
    dot = page.evaluate(
        """() => {
            const link = 'a[href="#episode=gapped/3"]';
            for (const use of document.querySelectorAll(`#gapped svg ${link} use`)) {
                use.scrollIntoView({block: "center"});
                const {x, y, width, height} = use.getBoundingClientRect();
                const [middleX, middleY] = [x + width / 2, y + height / 2];
                if (document.elementFromPoint(middleX, middleY)?.closest(link)) {
                    return [middleX, middleY];
                }
            }
        }"""
    )
    page.mouse.click(*dot)
    page.locator("#episode").wait_for()
    shown = rows_shown(page)
    assert [row[:3] for row in shown] == [["gapped", "3", name] for name in NAMES]
    assert f"seed {2**31 + 3}" in page.locator("#episode .which").inner_text()
    page.locator("#episode a", has_text="Show all").click()
    page.locator("#rows tbody tr").nth(20).wait_for()
    expect(page.locator("#episode")).to_be_hidden()


def test_an_episode_that_was_filmed_leads_to_its_videos(visit, report):
    page = visit()
    page.goto(f"{report.as_uri()}#episode=flat/0")
    page.get_by_role("link", name="Watch it").click()
    expect(page.locator("#videos-flat-0")).to_be_visible()
    page.goto(f"{report.as_uri()}#episode=flat/1")
    page.locator("#episode", has_text="film=[1]").wait_for()


def test_an_episode_that_is_not_there_is_told(visit, report):
    page = visit()
    page.goto(f"{report.as_uri()}#episode=flat/99")
    page.locator("#episode", has_text="no episode 99 on flat").wait_for()


def test_a_long_table_is_filled_bit_by_bit(visit, report, tmp_path):
    text = report.read_text(encoding="utf-8")
    assert "rowsAtOnce = 10000" in text
    short = tmp_path / "report.html"
    short.write_text(text.replace("rowsAtOnce = 10000", "rowsAtOnce = 7"), encoding="utf-8")
    page = visit(short, bypass_csp=True)  # its script is no longer the one that was hashed
    page.goto(f"{short.as_uri()}#episodes")
    rows = len(NAMES) * len(TERRAINS) * 5
    page.locator("#episodes", has_text=f"Showing 1 to 25 of {rows} entries").wait_for()
    page.goto(f"{short.as_uri()}#episode=gapped/4")  # the last ones
    wait_until(page, "document.querySelectorAll('#rows tbody tr').length === 3")
    assert [row[:3] for row in rows_shown(page)] == [["gapped", "4", name] for name in NAMES]


def test_rows_are_filtered_by_a_column(visit, report):
    page = visit()
    page.goto(f"{report.as_uri()}#episodes")
    assert {row[2] for row in rows_shown(page)} > {"cpg"}
    page.locator("#rows th", has_text="controller").locator(".dtcc-button_dropdown").click()
    page.locator(".dtcc-dropdown").get_by_role("button", name="cpg").click()
    wait_until(page, "document.querySelectorAll('#rows tbody tr').length === 10")
    assert {row[2] for row in rows_shown(page)} == {"cpg"}


def test_texts_of_strangers_run_no_script(visit, tmp_path):
    path = write_report(hostile_results(), tmp_path)
    page = visit(path, bypass_csp=True)  # the text alone must be harmless
    page.goto(f"{path.as_uri()}#episodes")
    hostile = HOSTILE[0]
    assert hostile in {row[2] for row in rows_shown(page)}
    page.locator("#rows th", has_text="controller").locator(".dt-column-title").click()
    wait_until(
        page,
        """() => {
            const names = [...document.querySelectorAll("#rows tbody td:nth-child(3)")]
                .map((cell) => cell.innerText);
            return names.every((name, i) => i === 0 || names[i - 1] <= name);
        }""",
    )
    page.locator("#rows th", has_text="controller").locator(".dtcc-button_dropdown").click()
    page.locator(".dtcc-dropdown").get_by_role("button", name="/script").click()
    wait_until(page, "document.querySelectorAll('#rows tbody tr').length === 6")
    assert {row[2] for row in rows_shown(page)} == {hostile}
    assert page.title() != "666"
    assert page.locator("img").count() == 0


def test_a_script_that_got_into_the_page_does_not_run(browser, report, tmp_path):
    bad = tmp_path / "report.html"
    inline = "<script>document.title = 666</script><img src=x onerror='document.title = 666'>"
    text = report.read_text(encoding="utf-8")
    bad.write_text(text.replace("</footer>", f"</footer>{inline}"), encoding="utf-8")
    titles, complaints = {}, []
    for bypass_csp in (False, True):
        context, heard = browser.new_context(offline=True, bypass_csp=bypass_csp), Heard()
        page = context.new_page()
        heard.listen(page)
        page.goto(bad.as_uri())
        titles[bypass_csp] = page.title()
        complaints.append(heard.complaints)
        context.close()
    assert titles[False].endswith("flyrl report")
    assert titles[True] == "666"
    assert sum("Content Security Policy" in each for each in complaints[0]) == 3


def test_rows_are_sorted_with_missing_values_last(visit, report):
    page = visit()
    page.goto(f"{report.as_uri()}#episodes")
    rows_shown(page)
    page.locator("#rows th", has_text="time to goal").locator(".dt-column-title").click()
    wait_until(
        page,
        """() => {
            const cells = [...document.querySelectorAll("#rows tbody td:nth-child(5)")];
            const values = cells.map((cell) =>
                cell.innerText === "\u2013" ? Infinity : Number(cell.innerText));
            const isSorted = values.every((value, i) => i === 0 || values[i - 1] <= value);
            return isSorted && values.includes(Infinity);
        }""",
    )


def test_figures_open_on_their_own(visit, report):
    figures = sorted((report.parent / "figures").iterdir())
    page = visit(figures[0])
    for figure in figures:
        page.goto(figure.as_uri())
        assert page.locator("svg").bounding_box()["width"] > 600, figure.name
        expect(page.locator("text").first, figure.name).to_be_visible()
