"""Checks of drawn frames, with and without an avatar. Vulkan draws them on the processor, in both programs."""

import json
import os
import random
import shutil
import struct
import wave
import zlib

from programs import Program
from report import LINUX, WINDOWS, last, report

SECONDS, FPS = 8, 5
# Name, parent, position in the T-pose in metres, half the size of a box.
BONES = [
    ("hips", None, (0.0, 0.7, 0.0), (0.12, 0.08, 0.08)),
    ("spine", "hips", (0.0, 0.8, 0.0), (0.1, 0.06, 0.07)),
    ("chest", "spine", (0.0, 0.9, 0.0), (0.12, 0.07, 0.08)),
    ("neck", "chest", (0.0, 1.08, 0.0), (0.04, 0.04, 0.04)),
    ("head", "neck", (0.0, 1.16, 0.0), (0.1, 0.12, 0.11)),
] + [
    (side + name, side + parent if parent[0].isupper() else parent, (sign * x, y, 0.0), half)
    for side, sign in (("left", 1), ("right", -1))
    for name, parent, (x, y), half in (
        ("UpperArm", "chest", (0.14, 1.04), (0.03, 0.04, 0.04)),
        ("LowerArm", "UpperArm", (0.34, 1.04), (0.03, 0.03, 0.03)),
        ("Hand", "LowerArm", (0.54, 1.04), (0.06, 0.02, 0.04)),
        ("UpperLeg", "hips", (0.08, 0.66), (0.05, 0.06, 0.05)),
        ("LowerLeg", "UpperLeg", (0.08, 0.36), (0.05, 0.06, 0.05)),
        ("Foot", "LowerLeg", (0.08, 0.07), (0.04, 0.07, 0.09)),
    )
]
NAMES = [bone[0] for bone in BONES]
SIDES = ([0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6])


def make_song(path: str) -> None:
    """Writes a song of noise on each beat of half a second."""
    noise = random.Random(1)
    level = [max(0.0, 1.0 - (i % 22050) / 3000) * 12000 for i in range(44100 * SECONDS)]
    with wave.open(path, "wb") as file:
        file.setparams((1, 2, 44100, 0, "NONE", ""))
        file.writeframes(struct.pack(f"<{len(level)}h", *(int(value * noise.uniform(-1, 1)) for value in level)))


def png() -> bytes:
    """A picture of one orange pixel."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">2I5B", 1, 1, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(b"\0\xf0\x80\x20")) + chunk(b"IEND", b"")


def avatar() -> bytes:
    """A VRM avatar (1.0): a box around each bone, and a picture on it."""
    data, views, accessors = bytearray(), [], []

    def view(content: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
        data.extend(content + bytes(-len(content) % 4))
        return len(views) - 1

    def numbers(values: list, code: str, kind: str, size: int) -> int:
        component = {"f": 5126, "H": 5123, "B": 5121}[code]
        place = view(struct.pack(f"<{len(values)}{code}", *values))
        accessors.append({"bufferView": place, "componentType": component, "type": kind, "count": len(values) // size})
        return len(accessors) - 1

    at, joints, weights, places, corners, inverse = [], [], [], [], [], []
    for n, (_, _, middle, half) in enumerate(BONES):
        for corner in range(8):
            at += [middle[axis] + (half[axis] if corner >> axis & 1 else -half[axis]) for axis in range(3)]
            joints += [n, 0, 0, 0]
            weights += [1.0, 0.0, 0.0, 0.0]
            places += [0.5, 0.5]
        corners += [8 * n + corner for a, b, c, d in SIDES for corner in (a, b, c, a, c, d)]
        inverse += [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *(-value for value in middle), 1]
    attributes = {"POSITION": numbers(at, "f", "VEC3", 3), "TEXCOORD_0": numbers(places, "f", "VEC2", 2)}
    attributes |= {"JOINTS_0": numbers(joints, "B", "VEC4", 4), "WEIGHTS_0": numbers(weights, "f", "VEC4", 4)}
    accessors[0] |= {"min": [-2, -2, -2], "max": [2, 2, 2]}
    primitive = {"attributes": attributes, "indices": numbers(corners, "H", "SCALAR", 1), "material": 0}
    skin = {"joints": list(range(len(BONES))), "inverseBindMatrices": numbers(inverse, "f", "MAT4", 16)}
    nodes = []
    for name, parent, place, _ in BONES:
        above = BONES[NAMES.index(parent)][2] if parent else (0.0, 0.0, 0.0)
        nodes.append({"name": name, "translation": [a - b for a, b in zip(place, above)]})
        if children := [n for n, bone in enumerate(BONES) if bone[1] == name]:
            nodes[-1]["children"] = children
    root = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes)]}],
        "nodes": [*nodes, {"name": "body", "mesh": 0, "skin": 0}],
        "meshes": [{"primitives": [primitive]}],
        "skins": [skin],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": view(png()), "mimeType": "image/png"}],
        "extensionsUsed": ["VRMC_vrm"],
        "extensions": {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": {name: {"node": n} for n, name in enumerate(NAMES)}}}},
    }
    root |= {"bufferViews": views, "accessors": accessors, "buffers": [{"byteLength": len(data)}]}
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<2I", 2, 28 + len(text) + len(data))
    return head + struct.pack("<I", len(text)) + b"JSON" + text + struct.pack("<I", len(data)) + b"BIN\0" + bytes(data)


def frames(program: Program, folder: str, *arguments: str) -> list[bytes]:
    """Draws the dance to the song of beats. Returns the frames."""
    shutil.rmtree(program.file(folder), ignore_errors=True)
    size = ("--size", "320x180", "--fps", str(FPS))
    code, out, err, took = program.run("render", "../film.wav", "--frames", folder, *size, *arguments, seconds=300)
    names = sorted(os.listdir(program.file(folder))) if os.path.isdir(program.file(folder)) else []
    pictures = [open(program.file(f"{folder}/{name}"), "rb").read() for name in names]
    good = code == 0 and len(pictures) == SECONDS * FPS and len(set(pictures)) == len(pictures)
    report(f"{program.name}: {folder}", good, f"{len(pictures)} frames, {took:.1f} s" if good else f"{len(pictures)} frames; {last(out + err)}")
    return pictures


def check_film() -> None:
    """Frames with and without an avatar. Wine's Vulkan is that of Linux, so both programs draw the same."""
    os.environ["WGPU_BACKEND"] = "vulkan"
    make_song("film.wav")
    with open("avatar.vrm", "wb") as file:
        file.write(avatar())
    drawn = {}
    for program in [program for program in (WINDOWS, LINUX) if program]:
        drawn[program.name] = frames(program, "film"), frames(program, "film with avatar", "--vrm", "../avatar.vrm")
    plain, dressed = drawn["Windows"]
    report("the avatar is drawn", bool(plain) and not set(plain) & set(dressed), f"{len(set(dressed) - set(plain))} other frames")
    if LINUX:
        same = [sum(a == b for a, b in zip(*pair)) for pair in zip(drawn["Windows"], drawn["Linux"])]
        report("frames as on Linux", min(same) == SECONDS * FPS, f"{same[0]} the same bytes, with the avatar {same[1]}")
    del os.environ["WGPU_BACKEND"]
