"""Runs in Blender, for `compare-fbx`.

write FILE.bvh FILE.fbx: Blender reads a BVH file and writes the motion as FBX.
compare FILE.fbx POSITIONS: compares the joints of the example `joint_positions` with those of Blender's FBX importer.
"""

import builtins
import json
import os
import sys

import bpy

TIMES = 20
LIMIT_MM = 1.0

# The importers of Blender 3.4 open files with a mode that its Python does not know any more.
real_open = builtins.open
builtins.open = lambda file, mode="r", *more, **named: real_open(file, mode.replace("U", ""), *more, **named)


def write(bvh: str, fbx: str) -> None:
    bpy.ops.import_anim.bvh(filepath=bvh, global_scale=0.01, update_scene_fps=True, update_scene_duration=True)
    bpy.ops.export_scene.fbx(filepath=fbx, add_leaf_bones=False, object_types={"ARMATURE"})


def compare(fbx: str, positions: str) -> bool:
    """Prints the largest distance, and returns true if it is within the limit."""
    with open(positions) as lines:
        motion = json.loads(next(lines))
    bpy.ops.import_scene.fbx(filepath=fbx, automatic_bone_orientation=False)
    scene = bpy.context.scene
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    first, last = armature.animation_data.action.frame_range
    fps = scene.render.fps / scene.render.fps_base
    ours = motion["positions"]
    worst, where = 0.0, ""
    compared = [name for name in motion["joints"] if name in armature.pose.bones]
    if len(compared) < 2:
        raise SystemExit(f"Error: Blender knows {len(compared)} of the joints {motion['joints']}")
    metres = None
    for step in range(TIMES):
        frame = round((len(ours) - 1) * step / (TIMES - 1))
        at = first + frame * fps / motion["fps"]
        scene.frame_set(int(at), subframe=at % 1)
        theirs = {}
        for name in compared:
            x, y, z = armature.matrix_world @ armature.pose.bones[name].head
            theirs[name] = (x, z, -y)
        mine = {name: ours[frame][motion["joints"].index(name)] for name in compared}
        if metres is None:
            # Blender has metres, the file its own unit.
            metres = min((1.0, 0.1, 0.01, 0.0254), key=lambda unit: distance(theirs, mine, unit)[0])
        apart, name = distance(theirs, mine, metres)
        if apart > worst:
            worst, where = apart, f"{name} in frame {frame}"
    print(f"{os.path.basename(fbx)}: {worst * 1000:.3f} mm apart at most ({where}; {len(compared)} joints, {TIMES} times, unit {metres} m)")
    return worst * 1000 <= LIMIT_MM


def distance(theirs: dict, mine: dict, unit: float) -> tuple[float, str]:
    """The largest distance of a joint in metres, and its name."""
    return max((sum((a - b * unit) ** 2 for a, b in zip(place, mine[name])) ** 0.5, name) for name, place in theirs.items())


command, *paths = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
if command == "write":
    write(*paths)
elif not compare(*paths):
    sys.exit(1)
