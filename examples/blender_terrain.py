"""An area in Blender, by its mesh from /mesh and by a height map from /grid:

    blender --background --python examples/blender_terrain.py -- http://127.0.0.1:8080/jacksboro OUT.png [WEST,SOUTH,EAST,NORTH [ERROR]]

Draws the mesh to OUT.png, and writes OUT.blend beside it. Without --background Blender shows the scene. Axes are metres east, north and up.
"""
import json
import math
import pathlib
import struct
import sys
import tempfile
import urllib.request

import bpy


def fetch(url):
    with urllib.request.urlopen(url, timeout=60) as reply:
        return reply.read(), reply.headers


def mesh(dataset, box, error):
    """The terrain as triangles with a bounded error, imported from OBJ: Debian 12's Blender cannot import glTF with its numpy."""
    body, headers = fetch(f"{dataset}/mesh?bbox={box}&error={error}&format=obj")
    path = pathlib.Path(tempfile.mkdtemp(), "area.obj")
    path.write_bytes(body)
    bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    made = next(thing for thing in bpy.context.selected_objects if thing.type == "MESH")
    made.name = "terrain"
    return made, headers["Terrain-Max-Error"]


def height_map(dataset, box, side=257):
    """The same area as a regular grid, as game engines import it: 16-bit integers, height = offset + scale * integer."""
    query = f"{dataset}/grid?bbox={box}&width={side}&height={side}"
    about = json.loads(fetch(f"{query}&format=json")[0])
    numbers = struct.unpack(f"<{side * side}H", fetch(f"{query}&format=r16")[0])
    west, south, east, north = map(float, box.split(","))
    metres_x = (east - west) * 111_320 * math.cos(math.radians((south + north) / 2)) / (side - 1)
    metres_y = (north - south) * 111_132 / (side - 1)
    nodes = [((i % side - (side - 1) / 2) * metres_x, ((side - 1) / 2 - i // side) * metres_y, about["offset"] + about["scale"] * number)
             for i, number in enumerate(numbers)]
    faces = [(i, i + side, i + side + 1, i + 1) for row in range(side - 1) for i in range(row * side, row * side + side - 1)]
    data = bpy.data.meshes.new("height map")
    data.from_pydata(nodes, [], faces)
    made = bpy.data.objects.new("height map", data)
    bpy.context.collection.objects.link(made)
    made.hide_set(True)
    made.hide_render = True
    return made


def heights(thing):
    ups = [(thing.matrix_world @ vertex.co).z for vertex in thing.data.vertices]
    return min(ups), max(ups)


def main(dataset, out, box="-84.3,36.2,-84.2,36.3", error="5"):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    terrain, error = mesh(dataset, box, error)
    grid = height_map(dataset, box)
    bpy.context.view_layer.update()
    low, high = heights(terrain)
    print(f"terrain: {len(terrain.data.polygons)} triangles, at most {error} m off, {low:.1f} to {high:.1f} m")
    print("height map: {} nodes, {:.1f} to {:.1f} m".format(len(grid.data.vertices), *heights(grid)))
    size = max(terrain.dimensions.x, terrain.dimensions.y)
    scene = bpy.context.scene
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.rotation_euler, sun.data.energy = (math.radians(70), 0, math.radians(45)), 2
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = (0, -1.2 * size, low + 0.9 * size)
    camera.rotation_euler = (math.radians(55), 0, 0)
    camera.data.clip_end = 10 * size
    for thing in (sun, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 640, 400
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 8, False  # needs no graphics card
    scene.render.filepath = str(pathlib.Path(out).resolve())
    bpy.ops.render.render(write_still=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(out).with_suffix(".blend").resolve()))


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1:])
