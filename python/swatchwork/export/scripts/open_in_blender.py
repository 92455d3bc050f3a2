# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Build this folder's object, material, light and cameras in Blender (4.0 or newer).

    blender --python open_in_blender.py                                 look at it
    blender -b --python open_in_blender.py -- --render --frame all      render into renders/

Cycles renders linear EXR, RGB premultiplied by alpha. The material is a diffuse lobe and one GGX lobe of the
fitted roughness (perceptual, as Blender's: its square is alpha); reflectance rises from the map at normal to
the map at grazing incidence as Schlick's formula does, by the cosine n.o to the viewer. The model that was
fitted rises by o.h: the loss that export.json states is of that model.
"""

import argparse
import json
import sys
from pathlib import Path

import bpy
from mathutils import Matrix

HERE = Path(__file__).resolve().parent


def image(nodes, name, colour):
    """An image node; data must not be colour-managed, and both are linear."""
    node = nodes.new("ShaderNodeTexImage")
    node.label = name
    node.image = bpy.data.images.load(str(HERE / f"{name}.exr"), check_existing=True)
    node.image.colorspace_settings.name = linear_space() if colour else "Non-Color"
    node.interpolation = "Linear"
    node.extension = "EXTEND"
    return node


def linear_space():
    """The name of linear Rec. 709: it changed with Blender 4."""
    settings = bpy.types.ColorManagedInputColorspaceSettings.bl_rna.properties["name"].enum_items
    names = {item.name for item in settings}
    return next((name for name in ("Linear Rec.709", "Linear") if name in names), "Non-Color")


def math_node(nodes, links, operation, *values):
    """A node of one operation on sockets or numbers."""
    node = nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, value in zip(node.inputs, values):
        if isinstance(value, (int, float)):
            socket.default_value = value
        else:
            links.new(value, socket)
    return node.outputs[0]


def vector_node(nodes, links, operation, *values):
    """The same for three channels at once."""
    node = nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    sockets = [s for s in node.inputs if s.type == "VECTOR"] + [s for s in node.inputs if s.name == "Scale"]
    if operation == "SCALE":
        sockets = [sockets[0], sockets[-1]]
    for socket, value in zip(sockets, values):
        if isinstance(value, (int, float, tuple)):
            socket.default_value = value
        else:
            links.new(value, socket)
    return node.outputs[0]


def material():
    """Diffuse (1 - D) below a GGX lobe of F, each risen to its value at grazing incidence by (1 - n.o)^5.

    D, of the dielectric map's red and green, is what the dielectric's share of the lobe alone takes.
    """
    found = bpy.data.materials.new("swatchwork")
    found.use_nodes = True
    nodes, links = found.node_tree.nodes, found.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    diffuse_map = image(nodes, "diffuse", True)
    normal_map = image(nodes, "normal_reflectance", True)
    grazing_map = image(nodes, "grazing_reflectance", True)
    dielectric_map = image(nodes, "dielectric", False)
    rough_map = image(nodes, "roughness", False)

    # With blend 1/2, "facing" is 1 - |n.o|.
    weight = nodes.new("ShaderNodeLayerWeight")
    weight.inputs["Blend"].default_value = 0.5
    rise = math_node(nodes, links, "POWER", weight.outputs["Facing"], 5.0)
    span = vector_node(nodes, links, "SUBTRACT", grazing_map.outputs["Color"], normal_map.outputs["Color"])
    fresnel = vector_node(
        nodes, links, "ADD", normal_map.outputs["Color"], vector_node(nodes, links, "SCALE", span, rise)
    )
    split = nodes.new("ShaderNodeSeparateXYZ")
    links.new(dielectric_map.outputs["Color"], split.inputs[0])
    at_normal, at_grazing = split.outputs[0], split.outputs[1]
    risen = math_node(
        nodes, links, "MULTIPLY", math_node(nodes, links, "SUBTRACT", at_grazing, at_normal), rise
    )
    taken = math_node(nodes, links, "ADD", at_normal, risen)
    beneath = vector_node(
        nodes,
        links,
        "SCALE",
        diffuse_map.outputs["Color"],
        math_node(nodes, links, "SUBTRACT", 1.0, taken),
    )

    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Roughness"].default_value = 0.0
    links.new(beneath, diffuse.inputs["Color"])
    glossy = nodes.new(
        "ShaderNodeBsdfAnisotropic"
        if hasattr(bpy.types, "ShaderNodeBsdfAnisotropic")
        else "ShaderNodeBsdfGlossy"
    )
    glossy.distribution = "GGX"
    links.new(fresnel, glossy.inputs["Color"])
    links.new(rough_map.outputs["Color"], glossy.inputs["Roughness"])
    both = nodes.new("ShaderNodeAddShader")
    links.new(diffuse.outputs[0], both.inputs[0])
    links.new(glossy.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Surface"])
    return found


def load_object():
    """The mesh in the world's own axes: nothing is turned on import."""
    bpy.ops.wm.obj_import(filepath=str(HERE / "mesh.obj"), forward_axis="Y", up_axis="Z")
    thing = bpy.context.selected_objects[0]
    thing.data.materials.clear()
    thing.data.materials.append(material())
    return thing


def world(light):
    """The environment, turned: a direction d in the world is looked up at R^T d."""
    found = bpy.data.worlds.new(light["file"])
    found.use_nodes = True
    nodes, links = found.node_tree.nodes, found.node_tree.links
    nodes.clear()
    coordinates = nodes.new("ShaderNodeTexCoord")
    mapping = nodes.new("ShaderNodeMapping")
    mapping.vector_type = "POINT"
    mapping.inputs["Rotation"].default_value = (
        Matrix(light["world_from_environment"]).transposed().to_euler("XYZ")
    )
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(HERE / light["file"]), check_existing=True)
    texture.image.colorspace_settings.name = linear_space()
    background = nodes.new("ShaderNodeBackground")
    output = nodes.new("ShaderNodeOutputWorld")
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    return found


def camera(frame):
    """A pinhole; lens distortion is left out."""
    data = bpy.data.cameras.new(frame["name"])
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = 36.0
    data.lens = frame["fx"] * 36.0 / frame["width"]
    aspect = frame["fx"] / frame["fy"]
    # Shifts are in parts of the sensor's width.
    data.shift_x = (frame["width"] / 2 - frame["cx"]) / frame["width"]
    data.shift_y = (frame["cy"] - frame["height"] / 2) * aspect / frame["width"]
    data.clip_start, data.clip_end = 1e-3, 1e4
    thing = bpy.data.objects.new(frame["name"], data)
    thing.matrix_world = Matrix(frame["world_from_camera"])
    bpy.context.scene.collection.objects.link(thing)
    return thing


def show(scene, frame, camera_of, world_of):
    """Set the scene to a frame."""
    scene.camera = camera_of[frame["name"]]
    scene.world = world_of[frame["light"]]
    render = scene.render
    render.resolution_x, render.resolution_y = frame["width"], frame["height"]
    render.resolution_percentage = 100
    aspect = frame["fx"] / frame["fy"]
    render.pixel_aspect_x, render.pixel_aspect_y = (1.0, aspect) if aspect >= 1 else (1 / aspect, 1.0)


def main():
    parser = argparse.ArgumentParser(prog="open_in_blender.py")
    parser.add_argument("--render", action="store_true")
    parser.add_argument("--frame", default="0", help="number of a frame in scene.json, or all")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument(
        "--bounces", type=int, default=0, help="0: direct light only, as the material was fitted"
    )
    parser.add_argument("--output", default=str(HERE / "renders"))
    args = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    described = json.loads((HERE / "scene.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    load_object()
    world_of = [world(light) for light in described["lights"]]
    camera_of = {frame["name"]: camera(frame) for frame in described["frames"]}

    scene.render.engine = "CYCLES"
    scene.cycles.samples = args.samples
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = args.bounces
    # A sample is cut off where it is brighter than this; never.
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    scene.render.film_transparent = True
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.image_settings.color_depth = "32"
    show(scene, described["frames"][0], camera_of, world_of)
    if args.render:
        frames = described["frames"]
        for frame in frames if args.frame == "all" else [frames[int(args.frame)]]:
            show(scene, frame, camera_of, world_of)
            scene.render.filepath = str(Path(args.output) / f"{frame['name']}.exr")
            bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
