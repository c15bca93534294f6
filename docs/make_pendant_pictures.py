"""The pictures of the window, in Chromium: `python -m docs.make_pendant_pictures` (needs chromium-driver).

A box far below real time, so that the browser, which draws without a graphics card, keeps up: an arm with a
gripper reaches for a block. Writes docs/img/pendant.png and pendant_phone.png, and the moving picture of the
README, docs/img/pendant.webp.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from PIL import Image
from selenium import webdriver

from ur_emulator import ControlBox

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "img"
SPEED = 0.04
REACH = """def reach_for_the_block():
  set_payload(0.9, [0, 0, 0.06])
  movej(get_inverse_kin(p[0.4, 0.35, 0.4, 3.14159, 0, 0]), a=3, v=1.5)
  movej(get_inverse_kin(p[0.5, 0.2, 0.25, 3.14159, 0, 0]), a=3, v=1.5)
  movel(p[0.5, 0.2, 0.18, 3.14159, 0, 0], a=1, v=0.3)
  movel(p[0.5, 0.2, 0.25, 3.14159, 0, 0], a=1, v=0.3)
  movej(get_inverse_kin(p[0.4, 0.35, 0.4, 3.14159, 0, 0]), a=3, v=1.5)
end
"""


@contextmanager
def page(box: ControlBox, width: int, height: int) -> Iterator[webdriver.Chrome]:
    """The window on a box in a browser of a size."""
    command = [sys.executable, "-m", "ur_emulator", "pendant", box.host, "--port", "0"]
    command += ["--control-port", str(box.control_port)]
    window = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    options = webdriver.ChromeOptions()
    for word in ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"):
        options.add_argument(word)
    options.add_argument(f"--window-size={width},{height}")
    options.add_argument("--hide-scrollbars")
    driver = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        assert window.stdout is not None
        driver.get(window.stdout.readline().removeprefix("window at ").strip())
        driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600},
        )
        time.sleep(8.0)
        driver.execute_script(
            "document.querySelectorAll('[class*=Notification]').forEach(one => one.remove())"
        )
        yield driver
    finally:
        driver.quit()
        window.terminate()
        window.wait()


def picture(driver: webdriver.Chrome) -> Image.Image:
    return Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")


def main() -> None:
    with ControlBox(
        "ur5e",
        port_base=None,
        control_port=0,
        seed=7,
        speed=SPEED,
        tool="robotiq-2f85",
        scene=ROOT / "examples" / "scene.toml",
    ) as box:
        with page(box, 1366, 768) as driver:
            frames, times = [], []
            box.run_program(REACH)
            while box.state.program_state == "PLAYING" or not frames:
                times.append(box.state.time)
                frames.append(picture(driver))
        frames[len(frames) // 3].save(IMAGES / "pendant.png", optimize=True)
        small = [frame.resize((854, 480), Image.Resampling.LANCZOS) for frame in frames]
        shown = [round(1e3 * (b - a)) for a, b in pairwise(times)]
        small[0].save(
            IMAGES / "pendant.webp",
            save_all=True,
            append_images=small[1:],
            duration=[*shown, 1000],
            loop=0,
            quality=55,
            method=6,
        )
        with page(box, 390, 844) as driver:
            picture(driver).save(IMAGES / "pendant_phone.png", optimize=True)


if __name__ == "__main__":
    main()
