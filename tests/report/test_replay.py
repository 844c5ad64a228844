"""The replay, driven in a real browser: it plays, scrubs and shows the numbers of the trace; nothing is injected.

Needs Debian's ``chromium`` and ``chromium-driver``. Where they are missing these tests are skipped, unless
``REACT_OPT_BROWSER=required`` is set, as it is in CI.
"""

from __future__ import annotations

import os
import re
import shutil

import numpy as np
import pytest
from documents import document
from small_trace import FACTORY, scripted

from react_opt import load, parse, save
from react_opt.instance import Failure, Link
from react_opt.limits.curve import coverage_bound, share_at
from react_opt.report.replay import replay_page
from react_opt.report.replay.blocks import in_blocks
from react_opt.report.show import show
from react_opt.sim.run import simulate
from react_opt.trace import NEVER, pixel_data

CHROMIUM, DRIVER = shutil.which("chromium") or shutil.which("google-chrome"), shutil.which("chromedriver")
FLAGS = """
    --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
    --disable-component-update --disable-sync --window-size=1280,800
"""
MOMENTS_S = (0.0, 12.5, 42.0)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Start one browser for all tests here."""
    if not (CHROMIUM and DRIVER):
        if os.environ.get("REACT_OPT_BROWSER") == "required":
            pytest.fail("REACT_OPT_BROWSER=required, but there is no chromium or no chromedriver")
        pytest.skip("NO BROWSER: install chromium and chromium-driver to test the replay")
    selenium = pytest.importorskip("selenium.webdriver")
    options = selenium.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in [*FLAGS.split(), f"--user-data-dir={tmp_path_factory.mktemp('profile')}"]:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = selenium.Chrome(options, selenium.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser, tmp_path):
    """Open the replay of traces; afterwards the browser must have had nothing to complain about."""

    def open_(*traces):
        page = tmp_path / "replay.html"
        names = [tmp_path / f"{k}.json" for k, _ in enumerate(traces)]
        for trace, name in zip(traces, names, strict=True):
            save(trace, name)
        show(names, page)
        browser.get(page.as_uri())
        until(browser, lambda: browser.execute_script("return document.body.dataset.ready") == "yes")
        return browser

    browser.get_log("browser")
    yield open_
    assert browser.get_log("browser") == []


def until(browser, condition):
    """Wait for something to become true."""
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(browser, 20, poll_frequency=0.05).until(lambda _: condition())


def text(browser, name):
    """Return what an element of the page says."""
    return browser.execute_script("return document.getElementById(arguments[0]).textContent", name)


def seconds(browser):
    """Return the time that the page's clock shows, s."""
    minutes, rest = text(browser, "clock").split(" / ")[0].split(":")
    return 60 * int(minutes) + float(rest)


def scrub(browser, t_s):
    """Move the slider to a time, as a hand would."""
    browser.execute_script(
        "const s = document.getElementById('scrub'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))", t_s
    )


@pytest.mark.parametrize("t_s", MOMENTS_S)
def test_scrubbing_shows_the_numbers_of_the_trace(opened, t_s):
    trace = scripted()
    browser = opened(trace)
    scrub(browser, t_s)
    frame = [frame for frame in trace.frames if frame.t_s <= t_s][-1]
    assert seconds(browser) == t_s
    assert text(browser, "known-0") == f"{100 * frame.coverage:.1f} %"
    for r, robot in enumerate(frame.robots):
        assert int(text(browser, f"battery-0-{r}").removesuffix(" J")) == pytest.approx(robot.battery_j, abs=0.6)
        assert text(browser, f"sensing-0-{r}") == ("on" if robot.sensing else "off")
        pose = browser.execute_script("return poseAt(replay.traces[0], arguments[0], arguments[1])", r, t_s)
        assert (pose["x"], pose["y"], pose["yaw"]) == pytest.approx((robot.x_m, robot.y_m, robot.yaw_rad), abs=0.006)
    assert text(browser, "link-0-0") == ("down" if t_s == 42.0 else "up")


@pytest.mark.parametrize("t_s", MOMENTS_S)
def test_the_map_shows_what_is_known_by_then_and_no_more(opened, t_s):
    trace = scripted()
    browser = opened(trace)
    scrub(browser, t_s)
    known, walls = trace.known.array("<u2"), trace.truth.array("u1") & 3 == 1
    by_then = (known != NEVER) & (known * trace.known.unit_s <= t_s + 1e-9)
    count = "return replay.stage.pictures[0].pixels.reduce((n, pixel) => n + (arguments[0].includes(pixel) ? 1 : 0), 0)"
    wall, free, fresh, hidden = 0xFF2A2A2A, 0xFFFFFFFF, 0xFFC8F0FF, 0xFFB4AEAC
    assert browser.execute_script(count, [wall]) == np.count_nonzero(by_then & walls)
    assert browser.execute_script(count, [free, fresh]) == np.count_nonzero(by_then & ~walls)
    assert browser.execute_script(count, [hidden]) == np.count_nonzero(~by_then & walls)
    browser.find_element("id", "walls").click()
    assert browser.execute_script(count, [hidden]) == 0


def test_it_plays_and_pauses_with_the_space_bar(opened):
    browser = opened(scripted())
    body = browser.find_element("tag name", "body")
    body.send_keys(" ")
    until(browser, lambda: seconds(browser) > 1)
    body.send_keys(" ")
    stopped = seconds(browser)
    assert text(browser, "play") == "Play"
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    assert seconds(browser) == stopped


def test_it_plays_to_the_end_and_stops_there(opened):
    trace = scripted()
    browser = opened(trace)
    scrub(browser, 59.0)
    browser.find_element("id", "play").click()
    until(browser, lambda: text(browser, "play") == "Play")
    assert seconds(browser) == 60.0
    assert text(browser, "known-0") == f"{100 * trace.frames[-1].coverage:.1f} %"


def test_it_steps_from_decision_to_decision_with_reason_and_bound(opened):
    browser = opened(scripted())
    seen = []
    for _ in range(4):
        browser.find_element("id", "next").click()
        seen.append((seconds(browser), text(browser, "decision-what"), text(browser, "decision-why")))
    assert seen == [
        (4.5, "Target taken: r1 → t1", "best worth 1.84"),
        (15.0, "Target deferred: t2", "outbid: r2 takes t1"),
        (26.0, "Target postponed: t2", "priority 0.4 below 1"),
        (31.0, "Plan made", "area 1,1 explored"),
    ]
    assert "proven bound150" in text(browser, "claim")
    browser.find_element("tag name", "body").send_keys("p")
    assert seconds(browser) == 26.0
    assert "proven bound172.5" in text(browser, "claim")
    assert text(browser, "targets-0") == "1 taken1 postponed"


def test_keys_move_through_time(opened):
    from selenium.webdriver.common.keys import Keys

    browser = opened(scripted())
    body = browser.find_element("tag name", "body")
    for key, t_s in ((Keys.END, 60.0), (Keys.ARROW_LEFT, 59.0), (Keys.HOME, 0.0), (Keys.ARROW_RIGHT, 1.0)):
        body.send_keys(key)
        assert seconds(browser) == t_s
    body.send_keys(Keys.SHIFT + Keys.ARROW_RIGHT)
    assert seconds(browser) == 11.0


def test_two_traces_play_side_by_side(opened):
    one, other = scripted(), scripted(coarse=8, name="coarser")
    browser = opened(one, other)
    scrub(browser, 30.0)
    for k, trace in enumerate((one, other)):
        frame = next(frame for frame in trace.frames if frame.t_s == 30.0)
        assert text(browser, f"known-{k}") == f"{100 * frame.coverage:.1f} %"
    assert "coarser" in text(browser, "title")


def test_text_from_files_is_shown_and_never_run(opened):
    evil = '</script><script>window.hacked=1</script><img src=x onerror="window.hacked=1">'
    data = scripted(name="x").model_dump(mode="json", by_alias=True)
    data["mission"]["name"] = data["mission"]["strategy"] = evil
    data["events"][0]["reason"] = data["events"][1]["target"] = evil
    for event in data["events"]:
        if event.get("claim"):
            event["claim"]["method"] = evil
    browser = opened(parse(data))
    scrub(browser, 2.0)
    assert browser.execute_script("return window.hacked") is None
    assert browser.find_elements("tag name", "img") == []
    assert text(browser, "title") == evil
    assert evil in text(browser, "decision-what")
    assert evil in text(browser, "claim")


def test_a_simulated_mission_with_an_outage_and_a_lost_robot(opened):
    link = Link(x_m=13.3, y_m=4.0, range_m=40.0, rate_bit_s=1e6, outages_s=((4.0, 8.0),))
    changes = {"horizon_s": 15.0, "link": link, "failures": (Failure(robot="r2", t_s=10.0),)}
    trace = simulate(load(FACTORY.parent / "mission_2.json").model_copy(update=changes), FACTORY.parent)
    browser = opened(trace)
    bound = coverage_bound(trace)
    for t_s, link_text, sensing in ((2.0, "up", "on"), (6.0, "down", "on"), (12.0, "up", "lost")):
        scrub(browser, t_s)
        frame = next(frame for frame in trace.frames if frame.t_s == t_s)
        assert text(browser, "known-0") == f"{100 * frame.coverage:.1f} %"
        assert int(text(browser, "battery-0-1").removesuffix(" J")) == pytest.approx(frame.robots[1].battery_j, abs=0.6)
        most = text(browser, "most-0").removeprefix("any team: at most ").removesuffix(" %")
        assert float(most) == pytest.approx(100 * share_at(bound, np.array([t_s]))[0], abs=0.06)
        assert text(browser, "link-0-1") == link_text
        assert text(browser, "sensing-0-1") == sensing
    replans = sorted({event.t_s for event in trace.events if event.type == "replan"})
    scrub(browser, replans[0])
    assert f"proven bound{float(f'{claim_at(trace, replans[0]).bound:.7g}'):g}"[:16] in text(browser, "claim")


def claim_at(trace, t_s):
    """Return the last claim of a solver by a time."""
    return [event.claim for event in trace.events if event.claim is not None and event.t_s <= t_s][-1]


@pytest.mark.parametrize("size", [(1600, 1000), (1024, 640), (420, 800)])
def test_nothing_is_cut_off_at_any_size(opened, size):
    browser = opened(scripted())
    browser.set_window_size(*size)
    wide = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
    browser.set_window_size(1280, 800)
    assert wide[0] <= wide[1]


# --- made-up traces ---

STRANGE = "Küchen-Späher 厨房 </script><b>bold</b>" + "x" * 80


def made_up(frames):
    """Return a trace told by nobody: twelve robots with strange ids, no events, no tracks, a turned map."""
    names = [f"{k} {STRANGE}" for k in range(12)]
    profile = document("mission")["profiles"]
    robots = [{"id": name, "profile": next(iter(profile)), "x_m": 2.0, "y_m": 3.0, "yaw_rad": 0.5} for name in names]
    grid = {"rows": 9, "cols": 14, "resolution_m": 0.5, "origin_x_m": -3.0, "origin_y_m": 7.25, "origin_yaw_rad": 0.7}
    known = np.arange(9 * 14, dtype=np.uint16).reshape(9, 14)
    told = [
        {
            "t_s": 5.0 * n,
            "coverage": round(0.0312 * n, 6),
            "robots": [
                {"id": name, "x_m": k / 2, "y_m": 9.0 + n, "yaw_rad": 3.0 * n, "sensing": k % 2 == 0, "battery_j": 0.0}
                for k, name in enumerate(names)
                if n != 1 or k != 3  # a frame that does not name every robot
            ],
        }
        for n in range(frames)
    ]
    mission = document("mission") | {"name": STRANGE, "robots": robots, "prior_map": None, "failures": [], "link": None}
    return parse(
        {
            "kind": "trace",
            "mission": mission,
            "seed": 0,
            "frames": told,
            "known": grid | {"unit_s": 0.1, "data": pixel_data(known)},
            "truth": grid | {"data": pixel_data(np.full((9, 14), 4, dtype=np.uint8))},
            "events": [],
        }
    )


@pytest.mark.parametrize("frames", [7, 1, 0])
def test_a_made_up_trace_opens_and_shows_its_coverage(opened, frames):
    trace = made_up(frames)
    browser = opened(trace)
    end = 5.0 * max(0, frames - 1)
    for t_s in (0.0, end / 2, end):
        scrub(browser, t_s)
        so_far = [frame for frame in trace.frames if frame.t_s <= t_s]
        assert text(browser, "known-0") == (f"{100 * so_far[-1].coverage:.1f} %" if so_far else "unknown")
        assert seconds(browser) == t_s
        assert text(browser, "clock").endswith(f"/ 0:{end:04.1f}")
    assert text(browser, "title") == STRANGE
    assert [cell.get_property("textContent") for cell in browser.find_elements("css selector", "td.id")] == [
        robot.id for robot in trace.mission.robots
    ]
    assert browser.find_elements("css selector", "#teams b") == []
    assert text(browser, "decision-when") == "none yet"
    assert "NaN" not in browser.execute_script("return document.body.innerText")
    assert browser.execute_script("return document.getElementById('failure').hidden")
    browser.find_element("id", "next").click()
    browser.find_element("id", "play").click()
    until(browser, lambda: seconds(browser) > 0 or end == 0)
    width = "return document.querySelector(arguments[0]).getBoundingClientRect().width"
    wide, beside = (browser.execute_script(width, name) for name in ("td.id", "aside"))
    assert wide < beside / 2  # long ids do not push batteries and sensors out of sight


# --- without a browser ---


def test_a_page_is_small_the_same_on_every_run_and_loads_nothing():
    trace = scripted(coarse=2)
    page = replay_page([trace])
    assert page == replay_page([trace])
    assert len(page) < 70_000
    assert not re.search(r"""(src|href)\s*=|https?://|url\(|@import""", page)


def test_walls_that_nobody_saw_can_be_kept_out_of_the_page():
    from react_opt.report.replay import _payload

    trace = scripted()
    pixels = trace.truth.model_copy(update={"data": _payload(trace, truth=False, bound=None)["truth"]}).array("u1")
    never = trace.known.array("<u2") == NEVER
    assert (pixels[never] == 3).all()
    assert (pixels[~never] == trace.truth.array("u1")[~never]).all()


def test_fine_pixels_are_shown_in_blocks_that_never_tell_more_than_was_known():
    trace = scripted()
    grid = trace.known
    fine = {"resolution_m": 0.05, "rows": 2 * grid.rows, "cols": 2 * grid.cols}
    rng = np.random.default_rng(0)
    known = rng.choice([3, 5, 9, NEVER], (2 * grid.rows, 2 * grid.cols)).astype(np.uint16)
    truth = rng.choice([0, 1, 2, 4], known.shape).astype(np.uint8)
    told = {"known": grid.model_copy(update={**fine, "data": pixel_data(known)})}
    told["truth"] = trace.truth.model_copy(update={**fine, "data": pixel_data(truth)})
    shown = in_blocks(trace.model_copy(update=told))
    assert (shown.known.rows, shown.known.cols, shown.known.resolution_m) == (grid.rows, grid.cols, 0.1)
    times, values = shown.known.array("<u2"), shown.truth.array("u1")
    for row, col in rng.integers(0, (grid.rows, grid.cols), (200, 2)):
        part = np.s_[2 * row : 2 * row + 2, 2 * col : 2 * col + 2]
        ever = known[part] != NEVER
        assert times[row, col] == (known[part][ever].max() if ever.any() else NEVER)
        counted = truth[part][ever] if ever.any() else truth[part].ravel()
        assert (values[row, col] & 3 == 1) == (counted & 3 == 1).any()
    assert in_blocks(shown) is shown
