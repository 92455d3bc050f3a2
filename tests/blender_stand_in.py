# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""As much of Blender's Python as open_in_blender.py asks of it, to find out what its nodes and cameras say.

Sockets are those of Blender's manual; values [..., 3] are vectors and colours, [...] numbers. Nothing is
rendered: a surface comes out as the colours of its diffuse and glossy parts.
"""

from __future__ import annotations

from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from swatchwork.arrays import F64

SOCKETS: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "ShaderNodeTexImage": ([("Vector", "VECTOR")], ["Color", "Alpha"]),
    "ShaderNodeMath": ([("Value", "VALUE")] * 3, ["Value"]),
    "ShaderNodeVectorMath": ([("Vector", "VECTOR")] * 3 + [("Scale", "VALUE")], ["Vector", "Value"]),
    "ShaderNodeSeparateXYZ": ([("Vector", "VECTOR")], ["X", "Y", "Z"]),
    "ShaderNodeLayerWeight": ([("Blend", "VALUE"), ("Normal", "VECTOR")], ["Fresnel", "Facing"]),
    "ShaderNodeBsdfDiffuse": ([("Color", "RGBA"), ("Roughness", "VALUE")], ["BSDF"]),
    "ShaderNodeBsdfAnisotropic": ([("Color", "RGBA"), ("Roughness", "VALUE")], ["BSDF"]),
    "ShaderNodeAddShader": ([("Shader", "SHADER")] * 2, ["Shader"]),
    "ShaderNodeOutputMaterial": ([("Surface", "SHADER")], []),
}


class Sockets(list[Any]):
    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(key) if isinstance(key, int) else next(s for s in self if s.name == key)


class Node:
    def __init__(self, kind: str) -> None:
        inputs, outputs = SOCKETS[kind]
        self.kind, self.operation = kind, ""
        self.inputs = Sockets(
            SimpleNamespace(name=n, type=t, default_value=0.0, source=None) for n, t in inputs
        )
        self.outputs = Sockets(SimpleNamespace(name=n, node=self, place=i) for i, n in enumerate(outputs))


class Nodes(list[Node]):
    def new(self, kind: str) -> Node:
        self.append(Node(kind))
        return self[-1]


class Links:
    def new(self, source: Any, into: Any) -> None:
        into.source = source


class Matrix(np.ndarray):
    def __new__(cls, rows: Any) -> Any:
        return np.asarray(rows, np.float64).view(cls)


def blender() -> tuple[ModuleType, ModuleType]:
    """The modules bpy and mathutils; images are known by their file."""

    def new(name: str, data: Any = None) -> SimpleNamespace:
        tree = SimpleNamespace(nodes=Nodes(), links=Links())
        return SimpleNamespace(name=name, data=data, node_tree=tree)

    def load(file: str, check_existing: bool) -> SimpleNamespace:
        return SimpleNamespace(file=file, colorspace_settings=SimpleNamespace(name=""))

    bpy, mathutils = ModuleType("bpy"), ModuleType("mathutils")
    made = SimpleNamespace(new=new)
    spaces = SimpleNamespace(enum_items=[SimpleNamespace(name="Linear Rec.709")])
    settings = SimpleNamespace(bl_rna=SimpleNamespace(properties={"name": spaces}))
    scene = SimpleNamespace(
        collection=SimpleNamespace(objects=SimpleNamespace(link=lambda thing: None)), render=SimpleNamespace()
    )
    vars(bpy).update(
        data=SimpleNamespace(
            materials=made, cameras=made, objects=made, images=SimpleNamespace(load=load), worlds=made
        ),
        types=SimpleNamespace(ColorManagedInputColorspaceSettings=settings, ShaderNodeBsdfAnisotropic=None),
        context=SimpleNamespace(scene=scene),
    )
    vars(mathutils).update(Matrix=Matrix)
    return bpy, mathutils


def shaded(nodes: Nodes, images: dict[str, F64], n_o: F64) -> dict[str, F64]:
    """Colours of the diffuse and glossy parts under an output, seen at cosines n.o [T], of images' rows."""

    def value(socket: Any) -> Any:
        if socket.source is None:
            return np.asarray(socket.default_value)
        node = socket.source.node
        if node.kind == "ShaderNodeTexImage":
            return images[node.label]
        if node.kind == "ShaderNodeLayerWeight":
            # Facing: 1 - |n.o| at blend 1/2.
            assert (socket.source.name, node.inputs["Blend"].default_value) == ("Facing", 0.5)
            return 1 - np.abs(n_o)
        given = [value(s) for s in node.inputs]
        if node.kind == "ShaderNodeSeparateXYZ":
            return given[0][..., socket.source.place]
        if node.operation == "SCALE":
            return given[0] * given[3][..., None]
        a, b = given[:2]
        return {
            "ADD": lambda: a + b,
            "SUBTRACT": lambda: a - b,
            "MULTIPLY": lambda: a * b,
            "POWER": lambda: a**b,
            "MAXIMUM": lambda: np.maximum(a, b),
        }[node.operation]()

    output = next(node for node in nodes if node.kind == "ShaderNodeOutputMaterial")
    both = output.inputs["Surface"].source.node
    parts = [socket.source.node for socket in both.inputs]
    return {part.kind: value(part.inputs["Color"]) for part in parts}


def seen(camera: Any, render: Any, x_in_world: F64) -> F64:
    """Pixels [P, 2] from the upper left where points [P, 3] appear, as BKE_camera_params has it."""
    assert camera.data.sensor_fit == "HORIZONTAL"
    x = (x_in_world - camera.matrix_world[:3, 3]) @ camera.matrix_world[:3, :3]
    width, height = render.resolution_x, render.resolution_y
    # In pixels' widths: the plane of the picture, and its shift.
    plane = np.asarray(x[:, :2] / -x[:, 2:]) * camera.data.lens / camera.data.sensor_width * width
    plane -= np.array([camera.data.shift_x, camera.data.shift_y]) * width
    high = render.pixel_aspect_y / render.pixel_aspect_x
    return np.column_stack([width / 2 + plane[:, 0], height / 2 - plane[:, 1] / high])
