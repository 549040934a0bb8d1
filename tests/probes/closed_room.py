"""A scene file of a closed room with a point light, rendered at 8 x 8 pixels."""

CLOSED_ROOM = """<scene version="3.0.0">
<default name="spp" value="4"/><default name="width" value="8"/>
<default name="height" value="8"/>
<integrator type="path"><integer name="max_depth" value="4"/>
  <integer name="rr_depth" value="100"/></integrator>
<sensor type="perspective">
  <transform name="to_world">
    <lookat origin="0,0,-0.9" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="$width"/>
    <integer name="height" value="$height"/><rfilter type="box"/></film>
  <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
</sensor>
<emitter type="point"><point name="position" x="0.1" y="0.2" z="0.3"/>
  <rgb name="intensity" value="1 2 3"/></emitter>
<shape type="cube"><boolean name="flip_normals" value="true"/>
  <bsdf type="diffuse"/></shape>
</scene>"""
