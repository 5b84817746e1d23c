"""Pages clicked through in headless Chromium: a script runs in a copy of the page and says what it found."""

import html
import json
import re
import shutil
import subprocess

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
         "--disable-background-networking", "--disable-component-update")
BUDGET = 20_000  # ms of the page's own clock, which runs ahead where nothing is to be done
BEFORE = """<script>
window.faults = [];
addEventListener("error", (event) => faults.push(String(event.message)));
addEventListener("unhandledrejection", (event) => faults.push(String(event.reason)));
console.error = (...said) => faults.push(said.join(" "));
// under a virtual clock there are few frames, or none: what waits for one comes soon, and everything is in sight
window.requestAnimationFrame = (call) => setTimeout(call, 16);
window.IntersectionObserver = class {
  constructor(call) { this.call = call; }
  observe(target) { setTimeout(() => this.call([{ target, isIntersecting: true }]), 16); }
};
</script>"""
AFTER = """<pre id="found"></pre><script>
(async () => {
  const found = {};
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const until = async (test) => { for (let i = 0; i < 200 && !test(); i++) await wait(50); };
  const settle = () => wait(100);
  const $ = (selector, root = document) => root.querySelector(selector);
  const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];
  const pixel = (canvas, x, y) => [...canvas.getContext("2d").getImageData(x, y, 1, 1).data].slice(0, 3);
  const point = (view, type, u, v, more = {}) => {
    const box = view.getBoundingClientRect();
    view.dispatchEvent(new PointerEvent(type, { bubbles: true, pointerType: "mouse", pointerId: 1,
      clientX: box.left + u * box.width, clientY: box.top + v * box.height, ...more }));
  };
  const press = (key, target = document.body, more = {}) =>
    target.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more }));
  try {
    SCRIPT
  } catch (error) {
    faults.push(`${error.message} ${error.stack}`);
  }
  found.faults = faults;
  document.getElementById("found").textContent = JSON.stringify(found);
})();
</script>"""


def clicked(page, script, folder, width=1400):
    """What a script finds in a page, as it was put into `found`; skips where there is no Chromium."""
    browser = next(filter(None, map(shutil.which, NAMES)), None)
    if browser is None:
        pytest.skip(f"none of {', '.join(NAMES)} is installed")
    copy = folder / "clicked.html"
    text = page.replace("<head>", "<head>" + BEFORE, 1)
    copy.write_text(text.replace("</body>", AFTER.replace("SCRIPT", script) + "</body>"), encoding="utf-8")
    done = subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={folder / 'profile'}", f"--window-size={width},1000", "--dump-dom",
         f"--virtual-time-budget={BUDGET}", copy.as_uri()], capture_output=True, text=True, timeout=120, check=False)
    said = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert said is not None
    assert said[1], f"the script did not end: {done.stderr[-2000:]}"
    return json.loads(html.unescape(said[1]))
