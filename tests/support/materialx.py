"""Documents of MaterialX that tests make."""

HEAD = '<?xml version="1.0"?>\n<materialx version="1.39" colorspace="lin_rec709" fileprefix="images/">\n'
# Texture coordinates through a place2d, and an image of them, as the output `colour` of N.
PICTURE = """  <nodegraph name="N">
    <geompropvalue name="st" type="vector2"><input name="geomprop" type="string" value="st" /></geompropvalue>
    <place2d name="place" type="vector2">
      <input name="texcoord" type="vector2" nodename="st" />
      <input name="scale" type="vector2" value="0.5 0.25" />
    </place2d>
    <image name="image" type="color3">
      <input name="file" type="filename" value="a.png" colorspace="srgb_texture" />
      <input name="texcoord" type="vector2" nodename="place" />
      <input name="uaddressmode" type="string" value="clamp" />
    </image>
    <output name="colour" type="color3" nodename="image" />
  </nodegraph>
"""


def material(name: str, shader: str, **inputs: float | str) -> str:
    """A material: numbers are floats, "a, b, c" colours, "N" is the output of PICTURE, "G.x" the output x of G."""
    lines = [f'  <{shader} name="S{name}" type="surfaceshader">']
    for key, value in inputs.items():
        kind = "color3" if isinstance(value, str) else "float"
        graph, _, output = ("N.colour" if value == "N" else str(value)).partition(".")
        source = f'nodegraph="{graph}" output="{output}"' if graph.isalpha() else f'value="{value}"'
        lines.append(f'    <input name="{key}" type="{kind}" {source} />')
    lines += [f"  </{shader}>", f'  <surfacematerial name="{name}" type="material">']
    lines += [f'    <input name="surfaceshader" type="surfaceshader" nodename="S{name}" />', "  </surfacematerial>"]
    return "\n".join(lines) + "\n"


def document(*materials: str) -> str:
    """A whole document with PICTURE."""
    return HEAD + PICTURE + "".join(materials) + "</materialx>\n"
