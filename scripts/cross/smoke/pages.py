"""Checks of the pages that set up a show (`corybant` alone) and import motions (`corybant import`)."""

import os
import re
import shutil
import time

from motions import SOURCE
from programs import Browser, Receiver, Running, on_page
from report import HAS_SOUND, WINDOWS, last, one_line, report


def read(path: str) -> bytes:
    """The bytes of a file."""
    with open(path, "rb") as file:
        return file.read()


def check_start(vmc: Receiver) -> None:
    """`corybant` alone: page, setup, a second start, motions, a saved show, the end."""
    vmc.times.clear()
    show, browser = Running(WINDOWS), Browser()
    link = show.until(lambda: re.search(r"http://\S+\?setup=[\w-]+", show.text()))
    report("start: link", bool(link), f"{time.monotonic() - show.start:.1f} s" if link else one_line(show.text()))
    if not link:
        show.wait(0)
        return
    status, page = browser.ask(link.group())
    report("start: page", status == 200 and 'id="setup"' in page, f"status {status}, {len(page)} bytes")
    status, state = browser.ask("/setup/state")
    report("start: setup", status == 200 and '"renderers"' in state, f"status {status}, {len(state)} bytes")
    status, _ = Browser().ask("/setup/state")
    report("start: another browser may not set up", status == 403, f"status {status}")
    status, inputs = browser.ask("/setup/inputs")
    report("start: inputs", status == 200 and (not HAS_SOUND or '"output"' in inputs), inputs[:300])
    if HAS_SOUND:
        status, text = browser.ask("/setup/input", {"input": "default"})
        changed = show.until(lambda: "audio.input" in show.text(), 10)
        report("start: another input", status == 200 and bool(changed), text[:100] if status != 200 else "taken over")
    status, text = browser.ask("/setup/renderer", {"id": "vseeface", "to": "127.0.0.1:39539"})
    report("start: renderer", status == 200 and '"vseeface"' in text, f"status {status}")
    count = len(vmc.times)
    show.until(lambda: len(vmc.times) > count + 120, 10)
    report("start: poses", len(vmc.times) > count + 120, vmc.summary())
    _, out, err, _ = WINDOWS.run(seconds=60)
    report("start: a second start", "runs already" in out + err, last(out + err))
    drop_motions(browser, vmc)
    save_show(browser)
    status, _ = browser.ask("/setup/quit", {})
    code = show.wait(10)
    report("start: end the show", code == 0, f"status {status}, exit {code}")
    run_saved(vmc)


def drop_motions(browser: Browser, vmc: Receiver) -> None:
    """Motions that are dropped on the page are built, and the show starts again with them."""
    for label, path in (("salsa", f"{SOURCE}/salsa.bvh"), ("my spin", "formats/fbx/spin/spin.fbx")):
        place = f"/setup/motions/{label.replace(' ', '%20')}/{os.path.basename(path)}"
        status, text = browser.ask(place, read(path))
        report(f"start: {os.path.basename(path)} is dropped", status == 200, f"status {status}{'' if status == 200 else ' ' + text[:200]}")
    start = time.monotonic()
    browser.ask("/setup/build", {})
    built = browser.until("/setup/state", lambda state: state["motions"]["state"] in ("done", "failed"))
    motions = built["motions"] if built else {"state": "no answer", "text": ""}
    report("start: the motions are built", motions["state"] == "done", f"{time.monotonic() - start:.1f} s; {motions['text']}")
    labels = ["my spin", "salsa"]
    danced = browser.until("/setup/state", lambda state: state["ready"] and state["own_motions"])
    hello = danced and on_page("hello", lambda hello: hello["labels"] == labels)
    count = len(vmc.times)
    moving = hello and browser.until("/setup/state", lambda _: len(vmc.times) > count + 60, 10)
    report("start: the show dances the motions", bool(moving), f"pads {labels} after {time.monotonic() - start:.1f} s" if moving else f"{danced}")


def save_show(browser: Browser) -> None:
    """The show is saved in the usual folder and in another one; an existing show is replaced only on request."""
    status, text = browser.ask("/setup/state")
    usual = re.search(r'"folder":"([^"]*)"', text)
    status, text = browser.ask("/setup/save", {"folder": usual.group(1).replace("\\\\", "\\") if usual else "", "name": "smoke", "replace": True})
    report("start: save in the usual folder", status == 200, text[:200])
    os.makedirs(WINDOWS.file("saved"), exist_ok=True)
    request = {"folder": WINDOWS.own_path("saved"), "name": "Bühne"}
    status, text = browser.ask("/setup/save", request)
    report("start: save in a folder", status == 200, text[:200])
    status, _ = browser.ask("/setup/save", request)
    report("start: an existing show is not replaced", status == 409, f"status {status}")
    status, text = browser.ask("/setup/shows", {"folder": request["folder"]})
    report("start: saved shows", "Bühne" in text, text[:200])
    status, text = browser.ask("/setup/open", request)
    report("start: open a saved show", status == 200, f"status {status}" if status == 200 else text[:200])


def run_saved(vmc: Receiver) -> None:
    """The saved show runs, also after a move of its folder."""
    shutil.rmtree(WINDOWS.file("moved"), ignore_errors=True)
    shutil.move(WINDOWS.file("saved"), WINDOWS.file("moved"))
    vmc.times.clear()
    code, out, err, _ = WINDOWS.run("run", "moved/Bühne.toml", "--seconds", "3")
    good = code == 0 and "labels: my spin, salsa" in out and len(vmc.times) > 120
    report("start: the saved show runs", good, vmc.summary() if good else one_line(out + err))


def check_import() -> None:
    """`corybant import`: files of three formats are dropped, labelled, built and saved."""
    show, browser = Running(WINDOWS, "import"), Browser()
    link = show.until(lambda: re.search(r"open (http://\S+)", show.text()))
    report("import: link", bool(link), f"{time.monotonic() - show.start:.1f} s" if link else one_line(show.text()))
    if not link:
        show.wait(0)
        return
    status, page = browser.ask(link.group(1))
    report("import: page", status == 200 and "<html" in page, f"status {status}, {len(page)} bytes")
    for path in (f"{SOURCE}/salsa.bvh", "formats/fbx/spin/spin.fbx", "formats/vmd/bow/bow.vmd"):
        name = os.path.basename(path)
        browser.ask(f"/setup/import/files/{name.split('.')[0]}/{name}", read(path))
    read_all = browser.until("/setup/import/state", lambda state: not state["busy"] and len(state["files"]) == 3)
    problems = [file["problem"] for file in read_all["files"]] if read_all else ["not read"]
    report("import: the files are read", not any(problems), f"problems: {problems}")
    change = {"file": "bow/bow.vmd", "label": "bow down", "start_s": 0.5, "end_s": None, "idle": False, "on_request": True, "mirror": False}
    status, text = browser.ask("/setup/import/clip", change, "PUT")
    report("import: a clip is changed", status == 200 and '"bow down"' in text, f"status {status}")
    browser.until("/setup/import/state", lambda state: not state["busy"])
    browser.ask("/setup/import/build", {})
    built = browser.until("/setup/import/state", lambda state: state["build"]["state"] in ("done", "failed"))
    build = built["build"] if built else {"state": "no answer", "text": ""}
    report("import: the graph is built", build["state"] == "done", one_line(build["text"]))
    status, dance = browser.ask("/setup/import/dance")
    report("import: its dance", status == 200 and len(dance) > 1000, f"status {status}, {len(dance)} characters")
    shutil.rmtree(WINDOWS.file("imported"), ignore_errors=True)
    os.makedirs(WINDOWS.file("imported"))
    status, text = browser.ask("/setup/import/save", {"folder": WINDOWS.own_path("imported"), "name": "舞台"})
    files = ["舞台/bow/bow.vmd", "舞台/clips.toml", "舞台/spin/spin.fbx", "舞台.graph"]
    missing = [file for file in files if not os.path.exists(WINDOWS.file(f"imported/{file}"))]
    report("import: save", status == 200 and not missing, f"missing: {missing or 'nothing'}; status {status}")
    browser.ask("/setup/import/quit", {})
    code = show.wait(10)
    report("import: the end", code == 0, f"exit {code}; {last(show.text())}")
    _, out, err, _ = WINDOWS.run("inspect", "imported/舞台.graph")
    report("import: the saved graph", "bow down" in out and "spin" in out, last(err) if err else f"{len(out)} characters")
