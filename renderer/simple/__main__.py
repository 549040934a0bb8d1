"""`python -m renderer.simple SCENE.xml -o OUT.png`: a scene file into a picture, slowly."""

from __future__ import annotations

import argparse
import sys

import numpy as np

from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.scene_file import read_file
from renderer.simple.path_tracer import render

parser = argparse.ArgumentParser(
    prog="python -m renderer.simple",
    description="Render a scene file with the simple path tracer: minutes, not seconds.",
)
parser.add_argument("scene", metavar="SCENE.xml")
parser.add_argument("-o", "--output", default="simple.png", metavar="OUT.png")
parser.add_argument("--spp", type=int, default=4, metavar="N", help="samples per pixel")
parser.add_argument("-D", dest="define", action="append", default=[], metavar="name=value")
options = parser.parse_args()
try:
    parameters = dict(text.split("=", 1) for text in options.define)
    picture = render(read_file(options.scene, **parameters), options.spp)
    Image(picture.astype(np.float32), spp=options.spp).save(options.output)
except SceneError as error:
    sys.exit(f"error: {error}")
