"""Checks of what changes a running show: a rebuilt graph, a live performer, a take. Two shows run at the same time."""

import os
import re
import shutil
import time

from programs import Receiver, Running, on_page, send_osc
from report import WINDOWS, last, one_line, report

FIXED = '[tempo]\nsource = "fixed"\nbpm = 120.0\n'
RECORD_PORT, PERFORMER_PORT = 39540, 39541
# A show beside another one, which has the usual ports. Its poses go to `record` and to the live performer of the other show.
PERFORMER = (
    f'[osc]\nlisten = "127.0.0.1:0"\n[page]\nlisten = "127.0.0.1:0"\n{FIXED}[[output]]\nkind = "vmc"\n'
    f'to = ["127.0.0.1:{RECORD_PORT}", "127.0.0.1:{PERFORMER_PORT}"]\n'
)


def poses_go_on(show: Running, vmc: Receiver, more: int = 120) -> str:
    """Waits for further poses. Returns how many came; empty if they are too few."""
    count = len(vmc.times)
    show.until(lambda: len(vmc.times) >= count + more, 15)
    return f"{len(vmc.times) - count} further poses" if len(vmc.times) >= count + more else ""


def check_graph_swap(vmc: Receiver) -> None:
    """`corybant build` replaces the graph of a running show, which goes on with the new motions."""
    shutil.copy(WINDOWS.file("bvh.graph"), WINDOWS.file("live.graph"))
    WINDOWS.write("swap.toml", f'{FIXED}[graph]\nfile = "live.graph"\n[[output]]\nkind = "vmc"\n')
    vmc.times.clear()
    show = Running(WINDOWS, "run", "swap.toml", "--record", "swap.tape")
    show.until(lambda: len(vmc.times) > 60)
    code, _, err, _ = WINDOWS.run("build", "../formats/fbx", "-o", "live.graph")
    start = time.monotonic()
    hello = on_page("hello", lambda hello: "spin" in hello["labels"])
    report("a rebuilt graph is taken over", code == 0 and bool(hello), f"after {time.monotonic() - start:.1f} s" if hello else last(err))
    send_osc("/cue/spin", 1.0)
    pad = hello["labels"].index("spin") if hello else -1
    danced = on_page("state", lambda state: state["label"] == pad)
    further = poses_go_on(show, vmc)
    report("the new label is danced", bool(danced and further), f"{further}; {vmc.summary()}")
    show.press_ctrl_c()
    code = show.wait(10)
    _, out, err, _ = WINDOWS.run("replay", "swap.tape", "--graph", "bvh.graph", "--graph", "live.graph", "--bvh", "swap.bvh")
    same = "the same, to the byte" in out + err
    report("the recorded change of the graph is replayed", code == 0 and same, f"exit {code}; {one_line(out + err)}")


def check_performer(vmc: Receiver) -> None:
    """`corybant record`, and a live performer whose take becomes a pad. Another show is the performer."""
    WINDOWS.write("performer.toml", PERFORMER)
    performer = Running(WINDOWS, "run", "performer.toml")
    code, out, err, took = WINDOWS.run("record", "recorded.bvh", "--listen", f"127.0.0.1:{RECORD_PORT}", "--seconds", "4", seconds=60)
    frames = re.search(r"(\d+) frames", out)
    good = code == 0 and frames and int(frames.group(1)) > 220
    report("record", bool(good), f"{took:.1f} s; {last(out)} {one_line(err)}")
    shutil.rmtree(WINDOWS.file("takes"), ignore_errors=True)
    text = f'{FIXED}[[output]]\nkind = "vmc"\n[[dancer]]\npass = ["head", "left_arm"]\n[[motion_in]]\nlisten = "127.0.0.1:{PERFORMER_PORT}"\n'
    WINDOWS.write("takes.toml", text)
    vmc.times.clear()
    show = Running(WINDOWS, "run", "takes.toml")
    show.until(lambda: len(vmc.times) > 60)
    send_osc("/record/start", "mine", 8)
    recorded = on_page("take", lambda take: take["phase"] == "recording", 20)
    hello = recorded and on_page("hello", lambda hello: "mine" in hello["labels"])
    kept = [path for path in ("takes/mine-1.bvh", "takes/graph-1.graph") if os.path.exists(WINDOWS.file(path))]
    report("a take becomes a pad", bool(hello) and len(kept) == 2, f"kept: {kept}" if hello else one_line(show.text())[-300:])
    send_osc("/cue/mine", 1.0)
    pad = hello["labels"].index("mine") if hello else -1
    danced = on_page("state", lambda state: state["label"] == pad)
    further = poses_go_on(show, vmc)
    report("the take is danced", bool(danced and further), f"{further}; {vmc.summary()}")
    for running in (show, performer):
        running.press_ctrl_c()
    codes = [running.wait(10) for running in (show, performer)]
    report("both shows end", codes == [0, 0], f"exit {codes}")
