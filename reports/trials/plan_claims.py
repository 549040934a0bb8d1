"""What the plan says it leaves out because the scene has none, checked bit for bit.

Each line under "What is left out, and why" names the simplifications that would leave it
out of the description as well: their pictures must be the same. Kinds that no
simplification is about, such as cylinders, have nothing that could be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from renderer.advice.simplifications import is_endless, words_of
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.rendering.aovs import nested_scene
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A line of the plan about what it leaves out, and what loses nothing therefore."""

    text: str
    words: list[str]  # NAME=VALUE whose pictures are the same; []: none is about that
    verbatim: bool  # so is that of the file's integrator without a plan, but for rounding


# what a line begins with -> words of the same; "no-light" is each of them
_SAME = {
    "multiple importance sampling": ("sampling=lights",),
    "Russian roulette": ("roulette=off",),
    "textures and uv": ("textures=mean",),
    "scattering": ("depth=2",),
    "lights, shadow rays, bounces": ("depth=1", "no-light"),
}
# kinds that a line lists as missing -> words of the same, if it lists them all
_DELTA = {name for name, kind in BSDFS.items() if kind.delta}
_KINDS = (
    ({"instances"}, "instances=flat"),
    ({"dielectric", "roughdielectric", "thindielectric"}, "glass=straight"),
    ({"conductor", "roughconductor"}, "metal=diffuse"),
    ({"plastic", "roughplastic", "principled"}, "specular=off"),
    ({"plastic", "roughplastic", "principled"}, "diffuse=off"),
    (_DELTA, "caustics=off"),
    ({"area", "constant", "envmap"}, "caustics=off"),
    ({"area", "constant", "envmap"}, "sampling=lights"),
)
# of integrators and samples: the file's own integrator gives the same picture
_VERBATIM = ("all samples but one per pixel", "more samples at each point")


def claims_of(scene: Scene, spp: int) -> list[Claim]:
    """Return what the plan of the colours leaves out, and how that can be checked."""
    plan = make_plan(scene, sampler="independent", spp=spp)
    nested = nested_scene(scene, plan)
    if nested is not None:
        plan = make_plan(nested, sampler="independent", spp=spp)
    impossible = {"roulette=off"} if is_endless(scene.description) else set()
    said = [line.partition("left out")[2].strip() for line in plan.lines]
    lights = [w for w in words_of(scene.description) if w.startswith("no-light=")]
    claims = [_claim(text, lights) for text in said if text]
    return [
        replace(claim, words=[w for w in claim.words if w not in impossible])
        for claim in claims
    ]


def _claim(text: str, lights: Sequence[str]) -> Claim:
    begin = next((begin for begin in _SAME if text.startswith(begin)), None)
    verbatim = text.startswith(_VERBATIM)
    if begin is not None:
        words = [w for w in _SAME[begin] if w != "no-light"]
        words += lights if "no-light" in _SAME[begin] else []
        return Claim(text=text, words=words, verbatim=False)
    missing = {name.strip() for name in text.partition(":")[0].split(",")}
    words = [word for kinds, word in _KINDS if kinds <= missing]
    return Claim(text=text, words=words, verbatim=verbatim)
