"""The window in a browser: Debian's Chromium, which draws without a graphics card, driven by selenium.

What people press acts on the box and is shown; what programs say stays text; the window outlives its box. The
first test is the journey of `make test`.
"""

import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial

import pytest

from ur_emulator import ControlBox

webdriver = pytest.importorskip("selenium.webdriver")
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(400),
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="needs chromium and chromedriver (Debian: chromium-driver)"),
]  # fmt: skip
SIZE = 1366, 900  # pixels
LIMIT = 100.0  # s, for hangs: a picture without a graphics card takes seconds


@contextmanager
def window(*words):
    """A window in a process of its own; gives its address."""
    command = [sys.executable, "-m", "ur_emulator", *words, "--port", "0"]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    try:
        yield process.stdout.readline().removeprefix("window at ").strip()
    finally:
        process.terminate()
        assert process.wait(LIMIT) == 0
        process.stdout.close()


@pytest.fixture(scope="module")
def driver():
    """A browser that has only the loopback interface to talk to."""
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"):
        options.add_argument(word)
    options.add_argument("--window-size={},{}".format(*SIZE))
    options.add_argument("--proxy-server=127.0.0.1:9")  # not of addresses of this machine
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.set_script_timeout(LIMIT)
    try:
        yield driver
    finally:
        driver.quit()


class Page:
    """A page of a window."""

    def __init__(self, driver, address):
        self.driver = driver
        driver.get(address)
        self.until(self.texts, "the panel")

    def until(self, condition, what):
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < LIMIT, f"{what}: {self.texts()}"
            time.sleep(0.05)

    def find(self, path):
        return [found for found in self.driver.find_elements("xpath", path) if found.is_displayed()]

    def tab(self, name):
        self.find(f"//*[@role='tab'][normalize-space()='{name}']")[0].click()

    def button(self, label):
        self.until(lambda: self.find(f"//button[normalize-space()='{label}']"), label)
        return self.find(f"//button[normalize-space()='{label}']")[0]

    def texts(self):
        """All that stands in fields."""
        return self.driver.execute_script(
            "return [...document.querySelectorAll('input,textarea')].map(field => field.value)"
        )

    def shows(self, text):
        self.until(lambda: any(text in value for value in self.texts()), f"{text!r} is not shown")


@pytest.fixture(scope="module")
def box():
    with ControlBox("ur5e", port_base=None, control_port=0, seed=7) as box:
        yield box


@pytest.fixture(scope="module")
def page(box, driver):
    with window("pendant", box.host, "--control-port", str(box.control_port)) as address:
        yield Page(driver, address)


@pytest.fixture
def opened(driver):
    """Opens an address in a tab of its own, so that `page` is there again afterwards."""
    first = driver.current_window_handle
    driver.switch_to.new_window("tab")
    yield partial(Page, driver)
    driver.close()
    driver.switch_to.window(first)
    driver.set_window_size(*SIZE)


def test_keys_act_on_the_box_and_a_joint_goes_as_long_as_its_button_is_held(box, page):
    page.tab("Robot")
    page.shows("UR5e 5.15.0")
    page.button("Power off").click()
    box.wait_until(robot_mode="POWER_OFF", timeout=LIMIT)
    page.shows("POWER_OFF")
    page.button("Release brakes").click()
    box.wait_until(robot_mode="RUNNING", timeout=LIMIT)
    page.shows("RUNNING")
    page.tab("Move")
    before = box.state.q[0]
    hold = webdriver.ActionChains(page.driver)
    hold.click_and_hold(page.button("base +")).perform()
    box.wait_until(program_state="PLAYING", timeout=LIMIT)
    page.until(lambda: box.state.q[0] > before + 0.1, "the joint")
    hold.reset_actions()
    webdriver.ActionChains(page.driver).release().perform()
    q = box.wait_until(program_state="STOPPED", steady=True, timeout=LIMIT).q
    assert q[1:] == pytest.approx(box.state.target_q[1:], abs=0.01)
    page.button("Emergency stop").click()  # it is there in every tab
    box.wait_until(safety_mode="ROBOT_EMERGENCY_STOP", timeout=LIMIT)
    page.button("Release").click()
    box.wait_until(safety_mode="NORMAL", timeout=LIMIT)
    box.release_brakes()
    box.wait_until(robot_mode="RUNNING", timeout=LIMIT)
    page.tab("Robot")
    page.shows("none (stopped)")
    loaded = page.driver.execute_script(
        "return performance.getEntriesByType('resource').map(one => one.name)"
    )
    own = page.driver.current_url
    assert all(name.startswith((own, "data:", "blob:")) for name in loaded)  # nothing of the network


HOSTILE = "<img src=x onerror=\\\"document.title='owned'\\\"><b>bold</b> [link](javascript:alert(1))"


@pytest.mark.nightly
def test_what_programs_say_is_text(box, page):
    said = HOSTILE.replace('\\"', "'")
    box.run_program(f'def says():\n  textmsg("{said}")\n  popup("{said}", "{said}")\nend\n')
    page.shows("<b>bold</b>")
    assert not page.driver.find_elements(
        "xpath", "//img[@src='x'] | //b[.='bold'] | //a[contains(@href,'script')]"
    )
    assert page.driver.title != "owned"
    box.close_popups()
    body = page.driver.find_element("tag name", "body")
    page.until(lambda: "A program says" not in body.text, "no popup")


@pytest.mark.nightly
def test_a_question_is_answered(box, page):
    program = 'def asks():\n  textmsg("it is ", request_integer_from_primary_client("how many?"))\nend\n'
    box.run_program(program)
    page.shows("how many?")
    (field,) = page.find("//label[normalize-space()='Integer']/following::input[1]")
    field.clear()
    field.send_keys("42")
    page.button("Answer").click()
    box.wait_until(log="it is 42", timeout=LIMIT)


@pytest.mark.nightly
def test_a_window_outlives_its_box(opened):
    """Also the kind of arm changes; as on the screen of a phone."""
    at = {"host": "127.0.0.29", "control_port": 29900}
    with window("pendant", "127.0.0.29", "--control-port", "29900") as address:
        with ControlBox("ur3", **at):
            page = opened(address)
            page.driver.set_window_size(390, 844)
            page.shows("UR3 3.15")
        page.shows("refuses")
        with ControlBox("ur5e", **at):
            page.shows("UR5e 5.15")


@pytest.mark.nightly
def test_a_robot_that_is_only_shown_has_no_buttons(box, opened):
    with window("pendant", box.host, "--control-port", str(box.control_port), "--view") as address:
        page = opened(address)
        page.shows("the robot is only shown")
        assert not page.driver.find_elements("xpath", "//button[normalize-space()='Power off']")
