"""Checks of running shows: page, commands, start and end, recordings, bars."""

import glob
import os
import signal
import time

from programs import Browser, Receiver, Running, on_page, send_osc
from report import LINUX, SHOW_FILE, WINDOWS, last, one_line, report, report_equal


def check_demo(vmc: Receiver) -> None:
    """Poses, page and OSC input of a show."""
    vmc.times.clear()
    demo = Running(WINDOWS, "demo", "--no-sound", "--seconds", "15")
    status, text = demo.until(lambda: (answer := Browser().ask("/"))[0] == 200 and answer) or (0, "no answer")
    report("page", status == 200, f"{len(text)} bytes" if status == 200 else one_line(demo.text()))
    send_osc("/intensity", 0.25)
    taken = on_page("state", lambda state: state["intensity"] == 0.25, 5)
    report("OSC input", bool(taken), "the intensity is 0.25" if taken else "the intensity does not change")
    code = demo.wait(40)
    report("demo", code == 0 and len(vmc.times) > 600, f"{vmc.summary()}; exit {code}")


def check_ends(vmc: Receiver, song: str) -> None:
    """Ctrl-C and its signal end a show soon, and its recording is whole. Wine sends no event for a closed console."""

    def interrupt(_) -> None:
        for process in WINDOWS.processes():
            os.kill(process, signal.SIGINT)

    for name, end in (("Ctrl-C", Running.press_ctrl_c), ("SIGINT", interrupt)):
        vmc.times.clear()
        show = Running(WINDOWS, "run", SHOW_FILE, "--input", f"file:../{song}", "--record", "end.tape")
        show.until(lambda: len(vmc.times) > 60)
        start = time.monotonic()
        end(show)
        code = show.wait(10)
        took = time.monotonic() - start
        _, out, err, _ = WINDOWS.run("replay", "end.tape")
        report(name, code == 0 and "the whole show" in out + err, f"exit {code} after {took:.2f} s; {last(out + err)}")
        for tape in glob.glob(WINDOWS.file("end*.tape")):
            os.remove(tape)


def check_recordings(vmc: Receiver, song: str) -> None:
    """Recordings of both programs, each replayed by both."""
    vmc.times.clear()
    code, out, err, _ = WINDOWS.run("run", SHOW_FILE, "--input", f"file:../{song}", "--seconds", "12", "--record", "show.tape")
    report("run with a file", code == 0 and len(vmc.times) > 400, f"{vmc.summary()}; {last(err)}")
    code, out, err, _ = WINDOWS.run("replay", "show.tape", "--bvh", "windows.bvh")
    report("replay", code == 0, last(out + err))
    if LINUX:
        LINUX.run("run", SHOW_FILE, "--input", f"file:../{song}", "--seconds", "12", "--record", "show.tape")
        code, out, err, _ = WINDOWS.run("replay", "../linux/show.tape", "--bvh", "linux.bvh")
        report("replay on Windows of Linux' recording", code == 0, last(out + err))
        LINUX.run("replay", "../windows/show.tape", "--bvh", "windows.bvh")
        LINUX.run("replay", "show.tape", "--bvh", "linux.bvh")
        report_equal("replay of Windows' recording", "windows.bvh")
        report_equal("replay of Linux' recording", "linux.bvh")


def check_bars(vmc: Receiver, song: str) -> None:
    """A running show finds how many beats the bars have: as many as `beats --bars` found at the end of the song."""
    with open(WINDOWS.file("beats.txt")) as beats:
        wanted = int(beats.read().split()[-1])
    vmc.times.clear()
    show = Running(WINDOWS, "run", SHOW_FILE, "--input", f"file:../{song}")
    show.until(lambda: vmc.times)
    found = on_page("state", lambda state: state["music"] and state["beats_per_bar"] == wanted, 60)
    report("beats per bar", bool(found), f"{wanted} after {found['t']:.1f} s" if found else f"not {wanted} within 60 s")
    show.press_ctrl_c()
    show.wait(10)
