"""Checks of the commands that write files and pages."""

import glob
import os
import re

from programs import Program, Running
from report import LINUX, SHOW, SHOW_FILE, WINDOWS, last, one_line, report, report_equal

RENDERED = (".glb", ".vrma", ".jsonl", ".sync.json")
SHELLS = ("bash", "zsh", "fish", "powershell", "elvish")


def make(program: Program, song: str | None) -> dict[str, float]:
    """Makes the files that are compared. Returns the durations of the commands in seconds."""
    seconds = {}

    def step(name: str, *arguments: str) -> str:
        code, out, err, took = program.run(*arguments)
        seconds[name] = took
        report(f"{program.name}: {name}", code == 0, f"{took:.1f} s" if code == 0 else last(err))
        return out

    program.write(SHOW_FILE, SHOW)
    program.write("check.txt", step("check", "check", SHOW_FILE))
    os.makedirs(program.file("man"), exist_ok=True)
    step("man", "man", "man")
    for shell in SHELLS:
        program.write(f"completions.{shell}", step(f"completions {shell}", "completions", shell))
    if os.path.isdir("motions"):
        step("build", "build", "../motions", "-o", "show.graph")
    for kind in ("bvh", "fbx", "vmd"):
        step(f"build {kind}", "build", f"../formats/{kind}", "-o", f"{kind}.graph")
        program.write(f"{kind}.txt", step(f"inspect {kind}", "inspect", f"{kind}.graph"))
    if song:
        program.write("beats.txt", step("beats", "beats", f"../{song}", "--bars"))
        step("rehearse", "rehearse", f"../{song}", "-o", "dance.bvh", "--poses", "dance.jsonl")
        step("render", "render", f"../{song}", "-o", "render.bvh")
        others = [word for ending in RENDERED for word in ("-o", f"other{ending}")]
        step("render other formats", "render", f"../{song}", "--graph", "fbx.graph", *others)
    return {f"`{name}`": seconds[name] for name in ("build", "beats", "rehearse", "render") if name in seconds}


def check_files(song: str | None) -> None:
    """Compares what both programs made, and what Windows' program writes to a console."""
    report_equal("result of check", "check.txt")
    console = Running(WINDOWS, "check", SHOW_FILE)
    console.wait(30)
    named = console.until(lambda: f"{SHOW_FILE}: OK" in console.text(), 1)
    report("console", named, one_line(console.text()))
    pages = sorted(os.path.basename(page) for page in glob.glob(WINDOWS.file("man/*.1")))
    report("manual pages", len(pages) > 10, f"{len(pages)} pages")
    report_equal("manual pages", *(f"man/{page}" for page in pages))
    report_equal("completions", *(f"completions.{shell}" for shell in SHELLS))
    if os.path.isdir("motions"):
        report_equal("graph", "show.graph")
    # FBX may differ in the last bits.
    report_equal("graphs of BVH and VMD", "bvh.graph", "vmd.graph")
    report_equal("contents of the graphs of BVH, FBX and VMD", "bvh.txt", "fbx.txt", "vmd.txt")
    if song:
        report_equal("beats", "beats.txt")
        report_equal("dance as BVH", "dance.bvh")
        report_equal("dance as JSON lines", "dance.jsonl")
        report_equal("rendered dance", "render.bvh")
        report_equal("rendered dances of other formats", *(f"other{ending}" for ending in RENDERED))


def check_doctor() -> None:
    """The page about the computer."""
    code, out, err, took = WINDOWS.run("doctor")
    sections = re.findall(r"(?m)^(\S.*)$", out)
    missing = {"Corybant", "Timing", "System", "MIDI ports", "Ports"} - set(sections)
    problems = one_line("\n".join(line for line in out.splitlines() if line.strip().startswith("!")))
    report("doctor", code == 0 and not missing, f"{took:.1f} s; problems: {problems or 'none'}; missing: {missing or 'nothing'}")
