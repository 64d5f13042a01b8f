"""The figures of both programs on this machine, as a table of Markdown."""

import json
import os
import statistics
import time

from programs import Program, Receiver, Running, share
from report import one_line, report

STARTS = 5
DEMO_S = 30
START_S_MAX = 120.0  # on a busy machine


def start_s(program: Program, poses: Receiver) -> float:
    """The median time from the start of the program to the first pose of a demo, in seconds."""
    times = []
    for _ in range(STARTS):
        poses.times.clear()
        demo = Running(program, "demo", "--no-sound")
        demo.until(lambda: poses.times, START_S_MAX)
        if poses.times:
            times.append(poses.times[0] - demo.start)
        else:
            report(f"{program.name}: start of the demo", False, f"exit {demo.child.poll()} after {time.monotonic() - demo.start:.1f} s")
        demo.press_ctrl_c()
        if demo.wait(10) is None or not poses.times:
            print(f"      {one_line(demo.text())}", flush=True)
    return statistics.median(times) if times else float("nan")


def usage(process: int) -> tuple[float, float]:
    """The processor time of a process in seconds, and its greatest memory in MiB."""
    fields = open(f"/proc/{process}/stat").read().rsplit(")", 1)[1].split()
    cpu = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    status = open(f"/proc/{process}/status").read()
    peak = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return cpu, int(peak.split()[1]) / 1024


def fastest_joint(path: str) -> float:
    """The greatest speed of a joint in a dance of JSON lines, in metres per second."""
    with open(path) as lines:
        fps = json.loads(next(lines))["fps"]
        before, fastest = {}, 0.0
        for line in lines:
            now = json.loads(line)["pos"]
            for joint, place in now.items():
                if joint in before:
                    fastest = max(fastest, sum((a - b) ** 2 for a, b in zip(place, before[joint])) ** 0.5 * fps)
            before = now
    return fastest


def of(program: Program, poses: Receiver, seconds: dict[str, float]) -> dict[str, str]:
    """Measures a program. `seconds` are the durations of its other commands."""
    figures = {"start to first pose": f"{start_s(program, poses):.2f} s"}
    poses.times.clear()
    demo = Running(program, "demo", "--no-sound", "--seconds", str(DEMO_S))
    demo.until(lambda: poses.times, START_S_MAX)
    begin = time.monotonic()
    process = program.processes()[0]
    before, _ = usage(process)
    time.sleep(DEMO_S - 5)
    after, memory = usage(process)
    cpu = (after - before) / (time.monotonic() - begin)
    demo.wait(30)
    gaps = poses.gaps_ms()
    figures["demo: packets (poses) per second"] = f"{poses.rate():.2f}"
    figures["demo: interval of packets, p50 / p99"] = f"{share(gaps, 0.5):.2f} / {share(gaps, 0.99):.2f} ms"
    figures["demo: processor time"] = f"{cpu * 100:.1f} % of a core"
    figures["demo: greatest memory"] = f"{memory:.0f} MiB"
    bench = json.loads(program.run("bench", "tick", "--seconds", "30", "--json")[1])
    late = bench["late_us"]
    figures["`bench tick`: lateness of poses, p50 / p99"] = f"{late['p50'] / 1e3:.3f} / {late['p99'] / 1e3:.3f} ms"
    figures["`bench tick`: missed poses of 3600"] = str(bench["missed_ticks"])
    for command, took in seconds.items():
        figures[command] = f"{took:.1f} s"
    if os.path.exists(program.file("dance.jsonl")):
        figures["fastest joint of the rehearsal"] = f"{fastest_joint(program.file('dance.jsonl')):.3f} m/s"
    return figures


def table(columns: dict[str, dict[str, str]]) -> str:
    """The figures of programs as a table. The key of a column is its heading."""
    names = list(columns)
    lines = ["| | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for row in columns[names[0]]:
        lines.append(f"| {row} | " + " | ".join(columns[name].get(row, "") for name in names) + " |")
    return "\n".join(lines)
