# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of a material, as far as assets are really made of them, as samplers that numpy evaluates.

Nothing here guesses: what is read is what Cycles shows, which the tests hold against its baker.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...metric.errors import ImageMissingError
from ...metric.texture import (
    MISSING,
    Alpha,
    Color,
    Extension,
    Interpolation,
    Placement,
    PlainColor,
    Texture,
    Tiles,
)
from .expressions import (
    AVERAGE,
    CHANNELS,
    LUMINANCE,
    OPERATIONS,
    Constant,
    Encoded,
    Grey,
    ImageAlpha,
    Light,
    Mix,
    Opacity,
    PlainLight,
    Value,
    VertexColor,
    arithmetic,
    clamped,
    evaluated,
    finite,
    plain_color,
    product,
    scaled,
    weighted,
)
from .image_files import (
    check_limits,
    has_pixels,
    image_header,
    image_path,
    reserve,
    same_content,
    tile_path,
    tile_place,
    why_unread,
)
from .images import Pixels, TextureCache, black_warnings
from .node_graph import NestedSocket, NotReadError, by_identifier, family, only_emits, source, upstream
from .types import MeshLayer, Reading
from .used_alpha import linked_alphas, opacity_alphas
from .uv_nodes import is_mapped, is_of_mesh, placement_of

MOST_NODES = 200  # of what feeds a base color; read trees are evaluated recursively
_EXTENSIONS: dict[str, Extension] = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "mirror"}
_INTERPOLATIONS: dict[str, Interpolation] = {
    "Linear": "linear",
    "Closest": "closest",
    "Cubic": "cubic",
    "Smart": "cubic",  # to Cycles they are the same
}
FIRST_ROLES = ("base color", "alpha")  # of the images, before all others


@dataclass(frozen=True)
class _Transparent:
    """What a Transparent BSDF is to the shaders that it is mixed with: nothing."""


class MaterialReader:
    """Reads one material; collects on the way what it wants of the mesh and what was assumed."""

    def __init__(
        self, material: bpy.types.Material, surface: NestedSocket, cache: TextureCache, reading: Reading
    ) -> None:
        self.layers: list[MeshLayer] = []
        self.warnings: list[str] = []
        self.notes: list[str] = []
        self._name = material.name
        self._surface = surface
        self._cache = cache
        self._reading = reading
        self._nodes = 0
        self._lost: float | None = None  # what an image that is missing counts as in an opacity; None in colors
        self._alphas = linked_alphas(material, ("Surface", "Volume", "Displacement"))

    def look(self) -> tuple[Color, Alpha | None]:
        """The material's color and opacity.

        Raises:
            MeshError: as read_look.
            NotReadError: a node is not read.
        """
        light, value = self._shader(source(self._surface))
        if isinstance(light, _Transparent):
            return PlainColor((0.0, 0.0, 0.0)), Opacity(Constant(0.0))
        color: Color
        if isinstance(light, PlainLight):
            color = plain_color(light.rgb)
        else:
            color = light if isinstance(light, Texture) else Encoded(light)
        opaque = isinstance(value, Constant) and value.number >= 1
        return color, None if opaque else Opacity(value)

    def channel(self, layer: MeshLayer) -> int:
        """The first channel of the corner values that belongs to a layer; adds it to what the mesh must offer."""
        if layer not in self.layers:
            self.layers.append(layer)
        return sum(each.width for each in self.layers[: self.layers.index(layer)])

    def _shader(self, place: NestedSocket) -> tuple[Light | _Transparent, Value]:
        """Color and opacity of what a shader output shows."""
        self.count(place)
        kind = place.node.type
        if not place.socket.is_output:
            raise NotReadError(place.node, "lacks a shader")
        if kind == "BSDF_PRINCIPLED":
            emits = only_emits(place.node)
            light = self._emission(place, "Emission ") if emits else self._light(place.input("Base Color"))
            return light, self._opacity(place.input("Alpha"))
        if kind == "BSDF_DIFFUSE":
            return self._light(place.input("Color")), Constant(1.0)
        if kind == "EMISSION":
            return self._emission(place), Constant(1.0)
        if kind == "BSDF_TRANSPARENT":
            return _Transparent(), Constant(0.0)
        if kind == "MIX_SHADER":
            return self._mixed_shader(place)
        raise NotReadError(place.node, "is a shader that is not read")

    def _emission(self, place: NestedSocket, prefix: str = "") -> Light:
        """What a shader emits, by its inputs Color and Strength, whose names begin with the prefix."""
        strength = self.number(place.input(f"{prefix}Strength"), place.node, "Strength")
        return scaled(self._light(place.input(f"{prefix}Color")), (strength,) * 3, (0.0,) * 3)

    def _mixed_shader(self, place: NestedSocket) -> tuple[Light | _Transparent, Value]:
        share = clamped(self._factor(place))
        if isinstance(share, Constant) and share.number in {0, 1}:
            shown, hidden = (2, 1) if share.number else (1, 2)
            light, value = self._shader(place.input(shown))
            if isinstance(light, _Transparent):  # what it covers still has a color
                light, _ = self._shader(place.input(hidden))
            return light, value
        (first, first_alpha), (second, second_alpha) = self._shader(place.input(1)), self._shader(place.input(2))
        if isinstance(first, _Transparent):
            return second, product(share, clamped(second_alpha))
        if isinstance(second, _Transparent):
            return first, product(arithmetic("subtract", Constant(1.0), share), clamped(first_alpha))
        raise NotReadError(place.node, "mixes two shaders")

    def _factor(self, place: NestedSocket) -> Value:
        """Of a mix of shaders. An image that is missing hides the transparent one."""
        self._lost = 0.0 if place.input(2).node.type == "BSDF_TRANSPARENT" else 1.0
        try:
            return self._value(place.input(0))
        finally:
            self._lost = None

    def _opacity(self, place: NestedSocket) -> Value:
        """The value at Alpha; opaque, with a warning, where it is not read."""
        known = len(self.layers)
        self._lost = 1.0
        try:
            return self._value(place)
        except NotReadError as error:
            del self.layers[known:]
            self.warnings.append(f"material {self._name}: its Alpha depends on {error}; it counts as opaque")
            return Constant(1.0)
        finally:
            self._lost = None

    def count(self, place: NestedSocket) -> None:
        """Counts a node that is read; NotReadError beyond MOST_NODES."""
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise NotReadError(place.node, "ends a tree of too many nodes")

    def _light(self, place: NestedSocket) -> Light:
        """The color at an input: of the output that feeds it, or its own."""
        self.count(place)
        node, socket = place.node, place.socket
        if not socket.is_output or node.type in {"RGB", "VALUE"}:
            value = socket.default_value
            # Vectors may have two dimensions.
            rgb = (value,) * 3 if socket.type == "VALUE" else (*tuple(value)[:3], 0.0)[:3]
            return PlainLight((finite(rgb[0]), finite(rgb[1]), finite(rgb[2])))
        if family(socket) == "VALUE":
            number = self._value(place)
            return PlainLight((number.number,) * 3) if isinstance(number, Constant) else Grey(number)
        if node.type == "TEX_IMAGE":
            texture = self._texture(place)
            return self._missing(node) if texture is None else texture
        if node.type in {"VERTEX_COLOR", "ATTRIBUTE"}:
            return self._attribute(node) or PlainLight((0.0, 0.0, 0.0))
        if node.type == "MIX" and node.data_type == "RGBA":
            return self._mix(place, ("Factor_Float", "A_Color", "B_Color"), node.clamp_factor, node.clamp_result)
        if node.type == "MIX_RGB":
            return self._mix(place, ("Fac", "Color1", "Color2"), True, node.use_clamp)
        if node.type == "VECT_MATH" and node.operation in {"MULTIPLY", "ADD", "MULTIPLY_ADD"}:
            return self._vector_math(place)
        raise NotReadError(node, "is not read")

    def _mix(self, place: NestedSocket, names: tuple[str, str, str], clamp_factor: bool, clamp: bool) -> Light:
        node = place.node
        if node.blend_type not in {"MIX", "MULTIPLY"}:
            raise NotReadError(node, f"blends by {node.blend_type.replace('_', ' ').lower()}")
        inputs = [source(NestedSocket(by_identifier(node.inputs, name, node), place.groups)) for name in names]
        factor = self.number(inputs[0], node, "factor")
        if clamp_factor:
            factor = min(max(factor, 0.0), 1.0)
        first, second = self._light(inputs[1]), self._light(inputs[2])
        mixed = Mix(first, second, factor, node.blend_type == "MULTIPLY", clamp)
        plain = isinstance(first, PlainLight) and isinstance(second, PlainLight)
        return evaluated(mixed) if plain else mixed

    def _vector_math(self, place: NestedSocket) -> Light:
        node = place.node
        lights = [self._light(place.input(number)) for number in range(3 if node.operation == "MULTIPLY_ADD" else 2)]
        if node.operation in {"MULTIPLY", "ADD"} and isinstance(lights[0], PlainLight):
            lights.reverse()
        constants = [light.rgb for light in lights[1:] if isinstance(light, PlainLight)]
        if len(constants) < len(lights) - 1:
            raise NotReadError(node, "combines two colors that vary")
        ones, zeros = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
        scale = ones if node.operation == "ADD" else constants[0]
        bias = zeros if node.operation == "MULTIPLY" else constants[-1]
        return scaled(lights[0], scale, bias)

    def _attribute(self, node: bpy.types.Node) -> VertexColor | None:
        """The color attribute that a node names; None where it names none."""
        if node.type == "VERTEX_COLOR":
            return VertexColor(self.channel(MeshLayer("color", node.layer_name)))
        if not is_of_mesh(node):
            raise NotReadError(node, "reads no attribute of the mesh")
        if node.attribute_name:
            return VertexColor(self.channel(MeshLayer("color", node.attribute_name)))
        text = f"material {self._name}: {node.name} names no attribute; it is black, as Blender renders it"
        self.notes.append(text)
        return None

    def check_images(self) -> None:
        """Refuses images that baking must not meet: Cycles decodes any size and shows missing ones in magenta.

        Raises:
            MeshError: as read_look.
        """
        self._lost = None
        held: dict[bpy.types.Image, None] = {}
        for node, role in dict.fromkeys(upstream(self._surface)):
            if node.type not in {"TEX_IMAGE", "TEX_ENVIRONMENT"} or role not in FIRST_ROLES:
                continue
            if node.image is not None:
                check_limits(node.image, self._reading.limits)
                held[node.image] = None
            if role == "base color" and not has_pixels(node.image):
                self._missing(node)
        # Cycles decodes them once more, all at a time, beside what it makes of them.
        headers = [image_header(image) for image in held]
        reserve(2 * sum(each.decoded for each in headers if each is not None), f"material {self._name}: its images")

    def _missing(self, node: bpy.types.Node) -> Light:
        """What stands in for an image that is missing or broken."""
        if self._lost is not None:
            return PlainLight((self._lost,) * 3)
        what = f"{node.name}, which feeds Base Color, holds no image" if node.image is None else why_unread(node.image)
        what = f"material {self._name}: {what}"
        if not self._reading.stand_in:
            raise ImageMissingError(f"{what}; repair it")
        self.warnings.append(f"{what}; magenta stands in for it")
        return PlainLight(MISSING)

    def _value(self, place: NestedSocket) -> Value:
        """The number at an input: of the output that feeds it, or its own."""
        self.count(place)
        node, socket = place.node, place.socket
        if family(socket) != "VALUE":
            return weighted(self._light(place), AVERAGE if socket.type == "VECTOR" else LUMINANCE)
        if not socket.is_output or node.type == "VALUE":
            return Constant(finite(float(socket.default_value)))
        if node.type == "TEX_IMAGE":
            texture = self._texture(place)
            return Constant(self._lost if self._lost is not None else 1.0) if texture is None else ImageAlpha(texture)
        if node.type == "VERTEX_COLOR" or (node.type == "ATTRIBUTE" and socket.name == "Alpha"):
            return self._attribute(node) or Constant(1.0)
        if node.type == "LIGHT_PATH" and socket.name.startswith("Is "):
            return Constant(float(socket.name == "Is Camera Ray"))  # the eye's
        if node.type == "SEPXYZ" or (node.type == "SEPARATE_COLOR" and node.mode == "RGB"):
            return weighted(self._light(place.input(0)), CHANNELS[socket.identifier])
        if node.type == "MATH" and node.operation in OPERATIONS:
            first = self._value(place.input(0))
            second = Constant(0.0) if node.operation == "ROUND" else self._value(place.input(1))
            return arithmetic(OPERATIONS[node.operation], first, second, node.use_clamp)
        if node.type == "MATH" and node.operation == "MULTIPLY_ADD":
            first, second, third = (self._value(place.input(number)) for number in range(3))
            return arithmetic("add", arithmetic("multiply", first, second), third, node.use_clamp)
        raise NotReadError(node, "is not read")

    def number(self, place: NestedSocket, node: bpy.types.Node, what: str) -> float:
        """The constant number at an input of a node; NotReadError where it varies."""
        value = self._value(place)
        if not isinstance(value, Constant):
            raise NotReadError(node, f"has a {what} that varies")
        return value.number

    def _texture(self, place: NestedSocket) -> Texture | Tiles | None:
        """The texture of an image node; None where its image is missing."""
        node = place.node
        image = node.image
        if image is None:
            return None
        if node.projection != "FLAT":
            raise NotReadError(node, f"has the projection {node.projection.lower()}")
        if is_mapped(node.texture_mapping):
            raise NotReadError(node, "has a mapping of its own")
        if image.source not in {"FILE", "GENERATED", "TILED"}:
            raise NotReadError(node, f"shows a {image.source.lower()}")
        known = len(self.layers)
        placement = placement_of(place.input("Vector"), self)
        texture = self._tiles(place, placement) if image.source == "TILED" else self._whole(place, placement)
        if texture is None:
            del self.layers[known:]
        return texture

    def _whole(self, place: NestedSocket, placement: Placement) -> Texture | None:
        node = place.node
        pixels = self._cache.pixels(node.image, self._reading.limits)
        if pixels is None and node.image.type == "MULTILAYER":  # Cycles reads its first layer, Python none
            raise NotReadError(node, "has an image of several layers")
        if pixels is None:
            return None
        texture = self._sampler(place, pixels, placement)
        if node.image.source == "FILE" and self._lost is None:
            texts = black_warnings(image_path(node.image) or node.image.name, pixels.values)
            self.warnings += [f"material {self._name}: {warning}" for warning in texts]
        return texture

    def _sampler(self, place: NestedSocket, pixels: Pixels, placement: Placement) -> Texture:
        node = place.node
        if not pixels.linear and node.image.colorspace_settings.name != "sRGB":
            raise NotReadError(node, f"has an image in the color space {node.image.colorspace_settings.name}")
        if pixels.unusual:
            raise NotReadError(node, "has an image that is stored in an unusual way")
        has_alpha = not pixels.solid and (pixels.values.shape[2] == 4 or node.extension == "CLIP")
        return Texture(
            pixels.values,
            extension=_EXTENSIONS[node.extension],
            interpolation=_INTERPOLATIONS[node.interpolation],
            linear=pixels.linear,
            unassociate=has_alpha and pixels.associated and self._uses_alpha(place),
            solid=pixels.solid,
            placement=placement,
        )

    def _uses_alpha(self, place: NestedSocket) -> bool:
        """Whether Cycles divides the color at an image's output by its alpha; NotReadError where that is not plain."""
        node = place.node
        if not any(same_content(node.image, other.node.image) for other in self._alphas):
            return False
        if any((other.node, other.groups) == (node, place.groups) for other in opacity_alphas(source(self._surface))):
            return True
        raise NotReadError(node, "has an alpha that is used, if not for its own opacity")

    def _tiles(self, place: NestedSocket, placement: Placement) -> Tiles | None:
        node, image = place.node, place.node.image
        if image.is_dirty:
            raise NotReadError(node, "has tiles with unsaved changes")
        tiles, missing = [], []
        for tile in image.tiles:
            pixels = self._cache.tile(image, tile.number, self._reading.limits)
            if pixels is None:
                missing.append(tile.number)
            else:
                tiles.append((tile_place(tile.number), self._sampler(place, pixels, Placement())))
        if tiles:
            self.warnings += [
                f"material {self._name}: {tile_path(image, number)}, a tile of its image, is missing or broken; "
                "it is magenta"
                for number in missing
            ]
        return Tiles(tuple(tiles), placement) if tiles else None

    def vector(self, place: NestedSocket, node: bpy.types.Node) -> tuple[float, float, float]:
        """The constant vector at an input of a node; NotReadError where it varies."""
        light = self._light(place)
        if not isinstance(light, PlainLight):
            raise NotReadError(node, "has an input that varies")
        return light.rgb
