"""Motion files of other formats, made from the BVH files of the tests: FBX as text, and VMD."""

import math
import os
import shutil
import struct

SOURCE = "/project/tests/data/motion"
FRAMES = 240
TICKS = 46_186_158_000  # of FBX in a second
LINEAR = 4  # interpolation of FBX


def make(folder: str) -> None:
    """Makes the folders `bvh`, `fbx` and `vmd`. Each has the two BVH files of the tests; `fbx` and `vmd` have another one."""
    for kind in ("bvh", "fbx", "vmd"):
        for label in ("salsa", "twist"):
            os.makedirs(f"{folder}/{kind}/{label}", exist_ok=True)
            shutil.copy(f"{SOURCE}/{label}.bvh", f"{folder}/{kind}/{label}/")
    os.makedirs(f"{folder}/fbx/spin", exist_ok=True)
    with open(f"{folder}/fbx/spin/spin.fbx", "w") as file:
        file.write(fbx(*read_bvh(f"{SOURCE}/twist.bvh")))
    os.makedirs(f"{folder}/vmd/bow", exist_ok=True)
    with open(f"{folder}/vmd/bow/bow.vmd", "wb") as file:
        file.write(vmd())


def read_bvh(path: str) -> tuple[list[tuple[str, int, list[float]]], float, list[list[float]]]:
    """Returns the joints of a BVH file (name, index of the parent, offset), the time of a frame in seconds, and the frames."""
    joints, stack, last = [], [], -1
    with open(path) as file:
        for line in file:
            words = line.split()
            if words[0] in ("ROOT", "JOINT"):
                joints.append((words[1], stack[-1] if stack else -1, []))
                last = len(joints) - 1
            elif words[0] == "End":
                last = None
            elif words[0] == "{":
                stack.append(last)
            elif words[0] == "}":
                stack.pop()
            elif words[0] == "OFFSET" and stack[-1] is not None:
                joints[stack[-1]][2].extend(map(float, words[1:]))
            elif words[0] == "Frame":
                frames = [[float(word) for word in line.split()] for line in file]
                return joints, float(words[2]), frames
    raise ValueError(f"{path} has no frames")


def xyz_angles(z: float, x: float, y: float) -> list[float]:
    """The angles about X, Y and Z, as FBX has them, of a rotation about Z, X and Y as the BVH files have it; all in degrees."""
    (sz, cz), (sx, cx), (sy, cy) = ((math.sin(a), math.cos(a)) for a in map(math.radians, (z, x, y)))
    # The elements of the matrix Rz Rx Ry that the angles need.
    down, side = [-cx * sy, sx, cx * cy], [cz * cy - sz * sx * sy, sz * cy + cz * sx * sy]
    angles = math.atan2(down[1], down[2]), -math.asin(max(-1.0, min(1.0, down[0]))), math.atan2(side[1], side[0])
    return [math.degrees(angle) for angle in angles]


def fbx(joints: list, frame_s: float, frames: list[list[float]]) -> str:
    """An FBX file as text: the joints, and their first frames as one take."""
    frames = frames[:FRAMES]
    objects, links = [], []

    def add(kind: str, number: int, name: str, kind_of_name: str, node: str, content: str = "") -> None:
        objects.append(f'{kind}: {number}, "{kind_of_name}::{name}", "{node}" {{\n{content}\n}}')

    def link(child: int, parent: int, name: str = "") -> None:
        links.append(f'C: "OP", {child}, {parent}, "{name}"' if name else f'C: "OO", {child}, {parent}')

    def curves(node: int, joint: int, name: str, values: list[list[float]]) -> None:
        add("AnimationCurveNode", node, name[4], "AnimCurveNode", "")
        link(node, 2)
        link(node, 100_000 + joint, name)
        times = ",".join(str(round(i * frame_s * TICKS)) for i in range(len(values)))
        for axis in range(3):
            column = ",".join(f"{value[axis]:.4f}" for value in values)
            lists = {"KeyTime": times, "KeyValueFloat": column, "KeyAttrFlags": LINEAR, "KeyAttrDataFloat": "0,0,0,0", "KeyAttrRefCount": len(values)}
            text = "\n".join(f"{key}: *{str(value).count(',') + 1} {{ a: {value} }}" for key, value in lists.items())
            add("AnimationCurve", node + 1 + axis, "", "AnimCurve", "", f"Default: 0\nKeyVer: 4008\n{text}")
            link(node + 1 + axis, node, "d|" + "XYZ"[axis])

    add("AnimationStack", 1, "spin", "AnimStack", "", f'Properties70: {{\nP: "LocalStop", "KTime", "Time", "",{round((len(frames) - 1) * frame_s * TICKS)}\n}}')
    add("AnimationLayer", 2, "BaseLayer", "AnimLayer", "")
    link(2, 1)
    for i, (name, parent, offset) in enumerate(joints):
        place = ",".join(map(str, offset))
        add("Model", 100_000 + i, name, "Model", "LimbNode", f'Properties70: {{\nP: "Lcl Translation", "Lcl Translation", "", "A",{place}\n}}')
        add("NodeAttribute", 200_000 + i, name, "NodeAttribute", "LimbNode", 'TypeFlags: "Skeleton"')
        link(100_000 + i, 0 if parent < 0 else 100_000 + parent)
        link(200_000 + i, 100_000 + i)
        curves(1_000_000 + 10 * i, i, "Lcl Rotation", [xyz_angles(*frame[3 + 3 * i : 6 + 3 * i]) for frame in frames])
    curves(2_000_000, 0, "Lcl Translation", [frame[:3] for frame in frames])
    parts = {"FBXHeaderExtension": "FBXHeaderVersion: 1003\nFBXVersion: 7400", "GlobalSettings": "Version: 1000", "Objects": "\n".join(objects)}
    parts["Connections"] = "\n".join(links)
    return "; FBX 7.4.0 project file\n" + "".join(f"{name}: {{\n{content}\n}}\n" for name, content in parts.items())


def vmd() -> bytes:
    """A VMD file in which the body goes down and up, and the back bends, on each beat of half a second."""
    keys = []
    for i in range(20):
        low = i % 2
        turn = math.radians(20.0 * low) / 2
        keys.append(("センター", 15 * i, (0.0, -1.5 * low, 0.0), (0.0, 0.0, 0.0, 1.0)))
        keys.append(("上半身", 15 * i, (0.0, 0.0, 0.0), (math.sin(turn), 0.0, 0.0, math.cos(turn))))
    linear = bytes([20] * 8 + [107] * 8)
    curve = b"".join(linear[shift:].ljust(16, b"\0") for shift in range(4))
    records = (
        name.encode("shift_jis").ljust(15, b"\0") + struct.pack("<I7f", frame, *place, *turn) + curve for name, frame, place, turn in keys
    )
    head = b"Vocaloid Motion Data 0002".ljust(30, b"\0") + b"Miku".ljust(20, b"\0")
    return head + struct.pack("<I", len(keys)) + b"".join(records) + bytes(20)
