"""The report in a real browser, driven as a reader would."""

import io
import time
from itertools import product

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from flyrl.report.video import FPS
from tests.chromium import chromium
from tests.report.conftest import BRIGHTER, DARKEST, FILMED, NAMES, TERRAINS
from tests.report.hostile import HOSTILE

WIDE = {"width": 1200, "height": 900}
LINKS = "nav[aria-label=Pages] a"
ROWS = len(NAMES) * len(TERRAINS) * 8


@pytest.fixture(scope="module")
def browser():
    with chromium("--disable-gpu") as browser:  # which software stands in for, at twice the cost
        yield browser


def listen(page):
    """What a page says that it should not, and all that it asks for, from now on."""
    complaints, requests = [], []
    bad = ("error", "warning")
    page.on("console", lambda said: said.type in bad and complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    return complaints, requests


USUAL = {"viewport": WIDE, "offline": True, "reduced_motion": "reduce"}


def check(complaints, requests):
    """No page may complain during a test, or ask for anything from elsewhere."""
    assert complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requests)


@pytest.fixture
def visit(browser, report):
    """Opens the report, or another page, as a reader with such a screen has it: `visit(**options)`.

    Options are those of a browser context.
    """
    contexts, heard = [], []

    def open_page(address="", path=report, **options):
        contexts.append(browser.new_context(**{**USUAL, **options}))
        page = contexts[-1].new_page()
        heard.append(listen(page))
        page.goto(f"{path.as_uri()}{address}")
        return page

    yield open_page
    for context in contexts:
        context.close()
    for each in heard:
        check(*each)


@pytest.fixture(scope="module")
def shared(browser, report):
    """One page that shows the report, and what is heard from it."""
    context = browser.new_context(**USUAL)
    page = context.new_page()
    heard = listen(page)
    page.goto(report.as_uri())
    yield page, heard
    context.close()


@pytest.fixture
def look(shared, report):
    """Goes to a place in the report, in a page that other tests have used: quicker than `visit`."""
    page, heard = shared

    def look(address):
        page.goto(f"{report.as_uri()}{address}")
        return page

    yield look
    page.set_viewport_size(WIDE)
    page.emulate_media(color_scheme="light")
    check(*heard)


def wait_until(page, script, argument=None):
    """Wait until a script is true; how Playwright itself waits, the page's policy forbids."""
    end = time.monotonic() + 30.0
    while not page.evaluate(script, argument):
        assert time.monotonic() < end, f"never so: {script}"
        page.wait_for_timeout(20)


def column(page, table, heading):
    """What a table shows below a heading, row by row, as it sorts by."""
    headings = page.locator(f"{table} th").all_inner_texts()
    number = next(i for i, text in enumerate(headings) if text.startswith(heading))
    return page.eval_on_selector_all(
        f"{table} td:nth-child({number + 1})",
        "(cells) => cells.map((cell) => cell.dataset.value ?? cell.innerText)",
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


def test_a_click_on_a_heading_sorts_and_another_turns_it_round_missing_values_last(look):
    page = look("#leaders")
    heading = page.locator("table.rates th", has_text="time to goal")
    for direction, sign in (("descending", -1), ("ascending", 1)):
        heading.locator("button").click()
        values = column(page, "table.rates", "time to goal")
        given = [float(value) for value in values if value]
        assert values[len(given) :] == [""] * (len(values) - len(given)) != []
        assert given == sorted(given, key=lambda value: sign * value) != given[::-1]
        assert heading.get_attribute("aria-sort") == direction


def test_every_link_of_the_navigation_shows_its_page_alone(look):
    page = look("#provenance")  # a section of a page
    expect(page.locator("#provenance")).to_be_visible()
    links = page.locator(LINKS).all()
    assert len(links) == 4 + len(TERRAINS)
    for link in links:
        link.click()
        expect(page.locator(link.get_attribute("href"))).to_be_visible()
        shown = [each for each in page.locator("main > .page").all() if each.is_visible()]
        assert ["#" + each.get_attribute("id") for each in shown] == [link.get_attribute("href")]
        assert link.get_attribute("aria-current") == "page"
    links[0].click()
    page.locator("#leaders a", has_text="gapped").click()
    expect(page.locator("#gapped h2")).to_be_visible()
    page.go_back()
    expect(page.locator("#leaders")).to_be_visible()


def test_the_navigation_stays_in_sight_and_leads_to_the_top_of_a_page(look):
    page = look("#flat")
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    page.locator("nav a", has_text="Gapped").click(no_wait_after=True)
    bar = page.locator(".pages").bounding_box()
    assert bar["y"] == pytest.approx(0, abs=1)
    assert bar["height"] <= page.locator("#gapped h2").bounding_box()["y"] < WIDE["height"] / 2


def test_no_column_is_cut_without_a_sign(look):
    page = look("#leaders")
    for width, link in product((1280, 800, 400), page.locator(LINKS).all()):
        page.set_viewport_size({"width": width, "height": 900})
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
        assert page.evaluate("document.documentElement.scrollWidth") == width


def test_text_is_readable_by_day_and_by_night_and_paper_is_white_without_controls(visit):
    page = visit("#flat")
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
    controls = page.locator("nav, #flat .clock")
    expect(controls.last).to_be_visible()
    page.emulate_media(media="print")
    assert not any(control.is_visible() for control in controls.all())
    assert style(page, "html", "backgroundColor") == "rgb(255, 255, 255)"
    assert all(each.is_visible() for each in page.locator("main > .page").all())


def test_videos_play_together_and_stand_still_once_their_page_is_left(look):
    page = look("#flat")
    count, are_paused, button, frame, last = page.evaluate(
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
            const shown = [Number(slider.value), Number(slider.max)];
            return [videos.length, arePaused, button.textContent, ...shown];
        }"""
    )
    assert (count, are_paused, button) == (len(NAMES), True, "Play")
    assert frame < last  # else they would have stopped anyway


def test_slider_and_curves_move_all_videos_and_the_line_in_the_curves(look):
    page = look("#flat")
    player = page.locator("#flat .player").first
    slider, curves = player.get_by_role("slider"), player.locator(".run-along svg")
    slider.focus()
    slider.press("Home")
    places = []
    for _ in range(2):
        for _ in range(3):
            slider.press("ArrowRight")
        wait_until(
            page,
            """(time) => [...document.querySelectorAll("#flat video")].every(
                (video) => Math.abs(video.currentTime - time) < 0.021)""",
            (int(slider.input_value()) + 0.5) / FPS,
        )
        places.append(player.locator(".run-along .cursor").first.bounding_box()["x"])
    assert slider.input_value() == "6"
    assert places[0] < places[1]
    curves.scroll_into_view_if_needed()
    box = curves.bounding_box()
    x, y = box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    clicked = int(slider.input_value())
    line = player.locator(".run-along .cursor").first.bounding_box()
    assert line["x"] == pytest.approx(x, abs=box["width"] / 40)  # one of 20 pictures in a half
    assert line["y"] <= y <= line["y"] + line["height"]
    page.mouse.move(x - 0.1 * box["width"], y)
    page.mouse.up()
    assert int(slider.input_value()) < clicked
    page.mouse.move(x, y)  # no longer held
    assert int(slider.input_value()) < clicked


def numbers(page):
    """Numbers of the picture that the time tells, and that the first video shows (brightness)."""
    wait_until(
        page,
        """() => [...document.querySelectorAll("#flat video")].every((video) => !video.seeking)""",
    )
    page.wait_for_timeout(100)  # until it is painted
    told_s = float(page.locator("#flat .clock output").inner_text().split()[0])
    picture = Image.open(io.BytesIO(page.locator("#flat video").first.screenshot())).convert("L")
    level = picture.getpixel((picture.width // 2, picture.height // 2))
    return round(told_s / 0.01), round((level - DARKEST) / BRIGHTER)


def test_the_time_told_is_that_of_the_picture(visit):
    page = visit("#flat")
    player = page.locator("#flat .player").first
    last = (FILMED - 1, FILMED - 1)
    assert numbers(page) == last  # the posters
    player.get_by_role("button", name="Play").click()
    wait_until(
        page,
        """() => {
            const {value} = document.querySelector("#flat .clock input");
            return 3 < value && value < 12;
        }""",
    )
    player.get_by_role("button", name="Pause").click()
    told, shown = numbers(page)
    assert told == shown
    slider = player.get_by_role("slider")
    slider.focus()
    slider.press("Home")
    for number in range(3):
        assert numbers(page) == (number, number)
        slider.press("ArrowRight")
    slider.press("End")
    assert numbers(page) == last


def rows_shown(page):
    page.locator("#rows tbody tr").first.wait_for()
    return [row.split("\t") for row in page.locator("#rows tbody tr").all_inner_texts()]


def choose(page, controller):
    """Filter the table of all episodes by a controller, whose name holds this text."""
    page.locator("#rows th", has_text="controller").locator(".dtcc-button_dropdown").click()
    page.locator(".dtcc-dropdown").get_by_role("button", name=controller).click()


def sort_by(page, heading, number):
    """Sort the table of all episodes by a column; missing values come last."""
    page.locator("#rows th", has_text=heading).locator(".dt-column-title").click()
    wait_until(
        page,
        """(number) => {
            const cells = document.querySelectorAll(`#rows tbody td:nth-child(${number})`);
            const values = [...cells].map(({ innerText: text }) =>
                text === "\u2013" ? Infinity : Number.isNaN(Number(text)) ? text : Number(text));
            return values.every((value, i) => i === 0 || values[i - 1] <= value);
        }""",
        number,
    )


def wait_for_rows(page, count):
    wait_until(page, "(n) => document.querySelectorAll('#rows tbody tr').length === n", count)


def test_a_dot_leads_to_what_everybody_did_in_its_episode(look):
    page = look("#gapped")
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


def test_an_episode_leads_to_its_videos_or_says_why_not(visit):
    page = visit("#episode=flat/1")
    for episode, note in ((1, "film=[1]"), (99, "no episode 99 on flat"), (0, "Watch it")):
        page.evaluate("(episode) => { location.hash = `episode=flat/${episode}`; }", episode)
        page.locator("#episode", has_text=note).wait_for()
    page.get_by_role("link", name="Watch it").click()
    expect(page.locator("#videos-flat-0")).to_be_visible()


def test_a_long_table_is_filled_bit_by_bit(visit, text, tmp_path):
    assert "rowsAtOnce = 10000" in text
    short = tmp_path / "report.html"
    short.write_text(text.replace("rowsAtOnce = 10000", "rowsAtOnce = 7"), encoding="utf-8")
    # its script is no longer the one that was hashed
    page = visit("#episodes", short, bypass_csp=True)
    page.locator("#episodes", has_text=f"Showing 1 to 25 of {ROWS} entries").wait_for()
    page.goto(f"{short.as_uri()}#episode=gapped/7")  # the last ones
    wait_for_rows(page, 3)
    assert [row[:3] for row in rows_shown(page)] == [["gapped", "7", name] for name in NAMES]


def test_rows_are_filtered_by_a_column_and_sorted_with_missing_values_last(visit):
    page = visit("#episodes")
    assert {row[2] for row in rows_shown(page)} > {"cpg"}
    choose(page, "cpg")
    wait_for_rows(page, 16)
    assert {row[2] for row in rows_shown(page)} == {"cpg"}
    sort_by(page, "time to goal", 5)
    assert rows_shown(page)[-1][4] == "\u2013"


def test_texts_of_strangers_run_no_script(visit, hostile_report):
    page = visit("#episodes", hostile_report, bypass_csp=True)  # the text alone must be harmless
    assert HOSTILE[0] in {row[2] for row in rows_shown(page)}
    sort_by(page, "controller", 3)
    choose(page, "/script")
    wait_for_rows(page, 6)
    assert {row[2] for row in rows_shown(page)} == {HOSTILE[0]}
    assert page.title() != "666"
    assert page.locator("img").count() == 0


def test_a_script_that_got_into_the_page_does_not_run(browser, text, tmp_path):
    bad = tmp_path / "report.html"
    inline = "<script>document.title = 666</script><img src=x onerror='document.title = 666'>"
    bad.write_text(text.replace("</footer>", f"</footer>{inline}"), encoding="utf-8")
    titles, complaints = [], []
    for bypass_csp in (False, True):
        context = browser.new_context(offline=True, bypass_csp=bypass_csp)
        page = context.new_page()
        complaints.append(listen(page)[0])
        page.goto(bad.as_uri())
        titles.append(page.title())
        context.close()
    assert titles[0].endswith("flyrl report") and titles[1] == "666"
    assert sum("Content Security Policy" in each for each in complaints[0]) == 3
