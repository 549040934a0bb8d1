"""Groups with every kind of primitive, in instances under all kinds of transforms."""

from __future__ import annotations

import numpy as np
from kernel_probes import directions, first_hit_plan, unit

from renderer.accelerators.build import build_accelerators

SPACING = 7.0
RAYS = 16_000
GROUPS = """
<shape type="rectangle" id="floor"><transform name="to_world"><scale value="90"/>
    <translate x="10" y="10" z="-5"/></transform></shape>
<shape type="shapegroup" id="many">
    <shape type="obj" id="mesh"><string name="filename" value="smooth.obj"/>
        <transform name="to_world"><rotate x="1" angle="70"/></transform></shape>
    <shape type="cube"><boolean name="flip_normals" value="true"/>
        <transform name="to_world"><scale value="0.4"/>
        <rotate z="1" angle="20"/><translate x="-1.5"/></transform></shape>
    <shape type="sphere"><point name="center" value="1.5,0,0"/>
        <float name="radius" value="0.6"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.8"/>
        <rotate y="1" angle="60"/><translate y="1.6" z="0.3"/></transform></shape>
    <shape type="disk"><boolean name="flip_normals" value="true"/>
        <transform name="to_world"><rotate x="1" angle="50"/>
        <translate y="-1.6"/></transform></shape>
    <shape type="cylinder"><point name="p0" value="0,0,1.2"/>
        <point name="p1" value="0.2,0.3,2"/><float name="radius" value="0.5"/></shape>
</shape>
<shape type="shapegroup" id="few">
    <shape type="sphere"><transform name="to_world"><scale value="-1.2"/></transform>
    </shape>
    <shape type="obj"><string name="filename" value="plain.obj"/></shape>
</shape>"""


# what the instances' transforms do, before they are moved apart; the group
INSTANCES = {
    "nothing": ("", "many"),
    "turned": ('<rotate x="0.6" z="0.8" angle="130"/>', "many"),
    "larger": ('<scale value="1.4"/><rotate y="1" angle="40"/>', "many"),
    "stretched": ('<scale x="0.5" y="1.5" z="0.8"/><rotate z="1" angle="30"/>', "many"),
    "mirrored": ('<scale x="-1"/>', "many"),
    "mirrored, slanted": (
        '<matrix value="-1 .4 0 0 0 1 .3 0 0 0 .7 0 0 0 0 1"/><rotate x="1" angle="33"/>',
        "many",
    ),
    "turned inside out": ('<scale value="-0.9"/>', "many"),
    "the other group": ('<rotate x="1" angle="15"/>', "few"),
    "the other group, mirrored": ('<scale z="-1.1"/>', "few"),
}


def middle(k):
    return SPACING * np.array([k % 3, k // 3, 0.0])


def moved(steps, k):
    x, y, z = middle(k)
    shift = f'<translate x="{x}" y="{y}" z="{z}"/>'
    return f'<transform name="to_world">{steps}{shift}</transform>'


def content():
    copies = [
        f'<shape type="instance" id="{name}"><ref id="{group}"/>{moved(steps, k)}</shape>'
        for k, (name, (steps, group)) in enumerate(INSTANCES.items())
    ]
    return GROUPS + "\n".join(copies)


def rays(seed, n=RAYS, distance=(3.0, 5.0)):
    """Rays at the instances, most from outside of them, the same number at each."""
    rng = np.random.default_rng(seed)
    k = np.arange(n) % len(INSTANCES)
    centre = np.array([middle(i) for i in k])
    target = centre + rng.uniform(0, 2, (n, 1)) * directions(n, rng)
    origin = target + rng.uniform(*distance, (n, 1)) * directions(n, rng)
    origin = origin.astype(np.float32)
    return origin, unit(target - origin).astype(np.float32)


def accelerators_of(scene, accel="auto"):
    return build_accelerators(scene, accel, first_hit_plan(scene).rays)
