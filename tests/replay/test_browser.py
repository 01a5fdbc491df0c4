"""The page in headless Chromium: it plays, says nothing on the console, loads nothing, fits a phone, knows the dark."""

import itertools
import json
import os
import select
import shutil
import subprocess
import time

import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.html import page_of
from rearl_jax.document.table import Cell, Row, Table
from rearl_jax.replay.player import player_of

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine: apt-get install chromium"),
]

PATIENCE = 60.0
"""Seconds after which the browser counts as stuck."""

QUIET = ("--disable-gpu", "--disable-background-networking", "--no-first-run", "--disable-dev-shm-usage")


class Tab:
    """A page in a browser of its own, driven over pipes by the DevTools protocol: messages end with a null byte."""

    def __init__(self, profile):
        down, up = os.pipe(), os.pipe()
        # The browser reads file descriptor 3 and writes 4.
        command = f'exec "$@" 3<&{down[0]} 4>&{up[1]}'
        arguments = [
            BROWSER,
            "--headless",
            "--no-sandbox",
            "--remote-debugging-pipe",
            f"--user-data-dir={profile}",
            *QUIET,
        ]
        self._browser = subprocess.Popen(
            ["bash", "-c", command, "browser", *arguments, "about:blank"],
            pass_fds=(down[0], up[1]),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(down[0])
        os.close(up[1])
        self._down, self._up = down[1], up[0]
        self._left, self._numbers, self._session = b"", itertools.count(1), None
        self.events = []
        pages = [one for one in self.call("Target.getTargets")["targetInfos"] if one["type"] == "page"]
        self._session = self.call("Target.attachToTarget", targetId=pages[0]["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def close(self):
        self._browser.terminate()
        self._browser.wait(PATIENCE)
        os.close(self._down)
        os.close(self._up)

    def call(self, method, **parameters):
        """The result of a command; what happened meanwhile is kept in `events`."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._down, json.dumps(message).encode() + b"\0")
        while True:
            found = self._read()
            if found.get("id") == number:
                assert "error" not in found, found
                return found["result"]
            self.events.append(found)

    def _read(self):
        while b"\0" not in self._left:
            ready, _, _ = select.select([self._up], [], [], PATIENCE)
            assert ready, "the browser does not answer"
            read = os.read(self._up, 1 << 20)
            assert read, "the browser has ended"
            self._left += read
        message, _, self._left = self._left.partition(b"\0")
        return json.loads(message)

    def ask(self, expression):
        """The value of an expression of JavaScript."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def until(self, expression):
        """Waits until an expression is true."""
        end = time.monotonic() + PATIENCE
        while not self.ask(expression):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.05)

    def press(self, key):
        """Presses and releases a key."""
        code = {" ": 32, "End": 35, "ArrowLeft": 37, "Tab": 9}[key]
        for kind in ("keyDown", "keyUp"):
            text = {"text": key} if key == " " and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **text)


@pytest.fixture
def page(replay, tmp_path):
    """The address of a page with a player."""
    document = Document("Scenes", "They drift.", (), "evaluate", generated=False)
    path = tmp_path / "page.html"
    path.write_text(page_of(document, EvaluateTask(), {}, player=player_of(replay)), encoding="utf-8")
    return path.as_uri()


@pytest.fixture
def tab(tmp_path):
    tab = Tab(tmp_path / "profile")
    yield tab
    tab.close()


HELP = """
const player = document.querySelector(".player"), part = name => player.querySelector(`[data-${name}]`);
const second = () => Number(player.dataset.second), picture = () => part("sim").toDataURL() + part("real").toDataURL();
const choose = (name, value) => { part(name).value = value; part(name).dispatchEvent(new Event("change")); };
"""


@pytest.mark.parametrize(("width", "scheme"), [(1100, "light"), (390, "dark")], ids=["desktop light", "phone dark"])
def test_the_replay_plays(page, tab, width, scheme):
    is_phone = width < 600
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=2, mobile=is_phone)
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    tab.call("Page.navigate", url=page)
    tab.until("document.readyState === 'complete' && document.querySelector('.player')?.dataset.ready === 'true'")
    tab.ask(HELP)
    last = 11
    assert tab.ask("second()") == 0

    first = tab.ask("picture()")
    tab.ask("part('play').focus(); part('speed').value = '10'")
    tab.press(" ")
    tab.until("second() > 2")
    assert tab.ask("[player.dataset.playing, part('play').textContent]") == ["true", "Pause"]
    assert tab.ask("picture()") != first
    tab.press(" ")
    stopped = tab.ask("second()")
    time.sleep(0.2)
    assert tab.ask("[player.dataset.playing, second()]") == ["false", stopped]
    tab.press("End")
    assert tab.ask("second()") == last
    tab.press("ArrowLeft")
    assert tab.ask("second()") == last - 1
    tab.ask("part('scrub').value = '7.5'; part('scrub').dispatchEvent(new Event('input'))")
    assert tab.ask("[second(), part('clock').textContent]") == [7.5, "7.5 s"]
    assert tab.ask("part('state').textContent").endswith("1 of 4 vehicles asked.")
    whole = tab.ask("picture()")
    tab.ask("choose('view', 'close')")
    assert tab.ask("picture()") != whole
    tab.ask("choose('scene', '1')")
    assert tab.ask("second()") == 0
    assert tab.ask("part('sim-note').textContent").startswith("run 0 of scene 4,")
    tab.ask("choose('speed', '10'); part('play').click()")
    tab.until(f"second() === {last} && player.dataset.playing === 'false'")  # it stops at the end
    assert tab.ask("part('state').textContent").endswith("1 crashed so far.")

    assert tab.ask("document.documentElement.scrollWidth") <= tab.ask("innerWidth") == width
    is_dark = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).every(part => part < 80)"
    assert tab.ask(is_dark) == (scheme == "dark")
    heard = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
    assert [event for event in tab.events if event.get("method") in heard] == []
    asked = [
        event["params"]["request"]["url"] for event in tab.events if event.get("method") == "Network.requestWillBeSent"
    ]
    assert asked
    assert all(url.startswith(("file:", "data:")) for url in asked)


@pytest.fixture
def wide_page(tmp_path):
    """The address of a page with a table of many columns."""
    headings = tuple(f"metric {number}" for number in range(9))
    row = Row(
        "+ start and desired speeds as recorded", tuple(Cell("0.453 ± 0.077", "0.412 to 0.484") for _ in headings)
    )
    section = Section(
        "Methods", tables=(Table("Errors of every method on the recordings of a motorway", headings, (row,)),)
    )
    folded = Section("Definitions", paragraphs=("H is a distance.",), is_folded=True)
    path = tmp_path / "wide.html"
    path.write_text(
        page_of(Document("Wide", "Wide.", (section, folded), "evaluate", False), EvaluateTask(), {}), encoding="utf-8"
    )
    return path.as_uri()


CUT = "[...document.querySelectorAll('table')].filter(one => one.getBoundingClientRect().right > innerWidth).length"


def test_paper_gets_whole_tables_in_dark_letters_from_a_dark_screen(wide_page, tab):
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    tab.call("Emulation.setDeviceMetricsOverride", width=690, height=900, deviceScaleFactor=1, mobile=False)
    tab.call("Page.navigate", url=wide_page)
    tab.until("document.readyState === 'complete'")
    is_dark = "getComputedStyle(document.body).color.match(/\\d+/g).every(part => part < 80)"
    tab.call("Emulation.setEmulatedMedia", media="screen", features=dark)
    assert [tab.ask(CUT), tab.ask(is_dark)] == [1, False]
    tab.call("Emulation.setEmulatedMedia", media="print", features=dark)
    assert [tab.ask(CUT), tab.ask(is_dark)] == [0, True]


def test_paper_gets_no_controls(page, tab):
    is_shown = "[...document.querySelectorAll('.controls')].map(one => one.getBoundingClientRect().height > 0)"
    tab.call("Page.navigate", url=page)
    tab.until("document.querySelector('.player')?.dataset.ready === 'true'")
    assert tab.ask(is_shown) == [True, True]
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.ask(is_shown) == [False, False]


def test_paper_gets_the_folded_sections_but_not_the_configuration(wide_page, tab):
    is_shown = "['details p', 'details pre'].map(one => document.querySelector(one).checkVisibility())"
    tab.call("Page.navigate", url=wide_page)
    tab.until("document.readyState === 'complete'")
    assert tab.ask(is_shown) == [False, False]
    tab.call("Emulation.setEmulatedMedia", media="print")
    assert tab.ask(is_shown) == [True, False]


def test_a_desk_shows_nine_metrics_at_once_and_a_phone_the_whole_caption(wide_page, tab):
    tab.call("Emulation.setDeviceMetricsOverride", width=1280, height=900, deviceScaleFactor=1, mobile=False)
    tab.call("Page.navigate", url=wide_page)
    tab.until("document.readyState === 'complete'")
    assert tab.ask(CUT) == 0
    tab.call("Emulation.setDeviceMetricsOverride", width=390, height=900, deviceScaleFactor=1, mobile=True)
    assert tab.ask(CUT) == 1
    assert tab.ask("document.querySelector('caption span').getBoundingClientRect().right") <= 390
