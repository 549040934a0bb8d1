"""The XML layer: parameters, includes, references, ids, old versions, and their errors."""

from __future__ import annotations

import itertools
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import SENSOR, error_of, mitsuba_refuses, ours, scene_text, theirs
from scene_xml import element, props, tag

from renderer import scene_file
from renderer.errors import SceneError
from renderer.scene_file.description import ConstantTexture, Diffuse

GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>'


def radius_of(text: str, **parameters: object) -> float:
    return scene_file.read_string(text, **parameters).shapes[0].to_world[0, 0]


# -------------------------------------------------------------- parameters

PARAMETRIC = scene_text(
    '<default name="r" value="2"/><default name="radius" value="${r}5"/>'
    '<shape type="sphere"><float name="radius" value="$r"/></shape>'.replace("${r}", "$r")
)


def test_default_gives_a_parameter_its_value() -> None:
    assert radius_of(PARAMETRIC) == 2.0


def test_parameter_from_outside_wins_over_the_default() -> None:
    assert radius_of(PARAMETRIC, r=3) == 3.0
    assert radius_of(PARAMETRIC, r="0.5") == 0.5


def test_longer_names_are_replaced_first() -> None:
    """With `r` = 2 and `radius` = 7, `$radius` must not become `2adius`."""
    text = scene_text(
        '<default name="r" value="2"/><default name="radius" value="7"/>'
        '<shape type="sphere"><float name="radius" value="$radius"/></shape>'
    )
    assert radius_of(text) == 7.0


def test_default_may_use_other_parameters() -> None:
    text = scene_text(
        '<default name="a" value="1"/><default name="b" value="$a.5"/>'
        '<shape type="sphere"><float name="radius" value="$b"/></shape>'
    )
    assert radius_of(text) == 1.5 == mi.load_string(text).shapes()[0].bbox().max[0]


def test_boolean_parameter_from_python_is_read_as_xml_writes_it() -> None:
    text = scene_text(
        '<shape type="sphere"><boolean name="flip_normals" value="$flip"/></shape>'
    )
    assert scene_file.read_string(text, flip=True).shapes[0].flip_normals
    assert not scene_file.read_string(text, flip=False).shapes[0].flip_normals


def test_any_name_can_be_a_parameter(tmp_path: Path) -> None:
    """Also those of our own arguments."""
    path = tmp_path / "scene.xml"
    path.write_text(PARAMETRIC.replace('"r"', '"path"').replace("$r", "$path"))
    assert scene_file.read_file(path, path=4).shapes[0].to_world[0, 0] == 4.0


def test_escaped_dollar_stays() -> None:
    content = (
        '<bsdf type="diffuse" id="a\\$b"/><shape type="sphere"><ref id="a\\$b"/></shape>'
    )
    assert len(ours(content).shapes) == len(theirs(content).shapes()) == 1


def test_undefined_parameter_is_an_error_with_line_and_known_names() -> None:
    content = '<default name="q" value="1"/>\n<shape type="sphere" id="$who"/>'
    message = error_of(content)
    assert message.startswith("<string>:3: undefined parameter $who")
    assert "$q" in message
    assert mitsuba_refuses(content)


def test_default_counts_from_its_line_on() -> None:
    content = '<shape type="sphere" id="$late"/>\n<default name="late" value="x"/>'
    assert "undefined parameter $late" in error_of(content)
    assert mitsuba_refuses(content)


def test_parameter_that_nothing_uses_is_an_error() -> None:
    with pytest.raises(SceneError, match=r"spq=4; the scene has: r, radius"):
        scene_file.read_string(PARAMETRIC, spq=4)
    with pytest.raises(RuntimeError):
        mi.load_string(PARAMETRIC, spq="4")


# ------------------------------------------------------- references and ids


def test_reference_stands_for_the_element_wherever_it_is_defined() -> None:
    content = (
        '<shape type="sphere"><ref id="late"/></shape><shape type="disk"><ref '
        'id="late"/></shape>' + GREY.format("0.1").replace("<bsdf", '<bsdf id="late"')
    )
    scene = ours(content)
    assert scene.shapes[0].bsdf.reflectance == ConstantTexture((0.1, 0.1, 0.1))
    assert scene.shapes[0].bsdf is scene.shapes[1].bsdf  # read once


def test_named_reference_and_alias() -> None:
    content = (
        '<texture type="checkerboard" id="board"/><alias id="board" as="squares"/>'
        '<shape type="sphere"><bsdf type="diffuse"><ref name="reflectance" '
        'id="squares"/></bsdf>'
        "</shape>"
    )
    assert ours(content).shapes[0].bsdf.reflectance.color0.rgb == (0.4, 0.4, 0.4)
    assert len(theirs(content).shapes()) == 1


def test_unknown_reference() -> None:
    content = (
        '<bsdf type="diffuse" id="wall"/>\n<shape type="sphere"><ref id="wal"/></shape>'
    )
    message = error_of(content)
    assert message.startswith('<string>:3: <ref> to the unknown id "wal"')
    assert "wall" in message
    assert mitsuba_refuses(content)


@pytest.mark.parametrize(
    "content",
    [
        '<bsdf type="twosided" id="a">\n<ref id="a"/></bsdf>',
        '<bsdf type="twosided" id="a">\n<ref id="b"/></bsdf>'
        '<bsdf type="twosided" id="b"><ref id="a"/></bsdf>',
    ],
)
def test_cyclic_reference(content: str) -> None:
    message = error_of(content)
    assert ": cyclic <ref>: a -> " in message
    assert message.endswith("-> a")
    assert mitsuba_refuses(content)


def test_chain_of_doubled_references_is_read_in_no_time() -> None:
    """Sharing must not be expanded: 60 levels of two would be 2^60 elements."""
    levels = "".join(
        f'<bsdf type="twosided" id="l{n}"><ref id="l{n + 1}"/><ref id="l{n + 1}"/></bsdf>'
        for n in range(60)
    )
    assert "twosided" in error_of(levels + '<bsdf type="diffuse" id="l60"/>')


def test_chain_of_references_has_an_end() -> None:
    levels = "".join(
        f'<bsdf type="twosided" id="l{n}"><ref id="l{n + 1}"/></bsdf>' for n in range(5000)
    )
    message = error_of(levels + '<bsdf type="diffuse" id="l5000"/>')
    assert "more than 200 elements inside each other by <ref>" in message


def test_duplicate_id_and_property_and_child() -> None:
    message = error_of('<bsdf type="diffuse" id="a"/>\n<bsdf type="diffuse" id="a"/>')
    assert message.startswith('<string>:3: id "a" is taken already')
    assert "<string>:2" in message
    twice = '<shape type="sphere">\n<float name="radius" value="1"/>\n{}</shape>'
    message = error_of(twice.format(props(radius=1.0)))
    assert message.startswith('<string>:4: shape "sphere" has two properties "radius"')
    message = error_of(
        '<shape type="sphere"><bsdf type="diffuse"/>\n<bsdf type="diffuse"/></shape>'
    )
    assert message.startswith('<string>:3: a second <bsdf> in shape "sphere"')


# ---------------------------------------------------------- include and path


def test_include_gives_its_objects_and_ids(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "bsdfs.xml").write_text(
        '<scene version="3.0.0"><default name="grey" value="0.25"/>'
        + GREY.format("$grey").replace("<bsdf", '<bsdf id="wall"')
        + '<shape type="disk"/></scene>'
    )
    (tmp_path / "one.xml").write_text('<shape version="3.0.0" type="cylinder"/>')
    content = (
        '<include filename="parts/bsdfs.xml"/><shape type="sphere"><ref id="wall"/></shape>'
        '<include filename="one.xml"/>'
    )
    scene = ours(content, folder=tmp_path)
    kinds = [type(shape).__name__ for shape in scene.shapes]
    assert kinds == ["Disk", "Sphere", "Cylinder"]
    assert kinds == [s.class_name() for s in theirs(content, folder=tmp_path).shapes()]
    assert scene.shapes[1].bsdf.reflectance == ConstantTexture((0.25, 0.25, 0.25))
    assert scene.shapes[0].location.file.endswith("bsdfs.xml")
    names = [Path(file).name for file in scene.files]
    assert names == ["bsdfs.xml", "one.xml"]


def test_cyclic_include(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.xml").write_text(
            f'<scene version="3.0.0">\n<include filename="{other}.xml"/></scene>'
        )
    with pytest.raises(SceneError) as caught:
        scene_file.read_file(tmp_path / "a.xml")
    assert str(caught.value) == (
        f"{tmp_path / 'b.xml'}:2: cyclic <include>: a.xml -> b.xml -> a.xml"
    )


def test_missing_include_says_where_it_was_looked_for(tmp_path: Path) -> None:
    message = error_of('<include filename="gone.xml"/>', folder=tmp_path)
    assert message.startswith('<string>:2: the included file "gone.xml" not found')
    assert str(tmp_path) in message


def test_include_of_loose_properties_is_refused(tmp_path: Path) -> None:
    """Mitsuba drops them without a word."""
    (tmp_path / "loose.xml").write_text('<scene version="3.0.0"><ref id="x"/></scene>')
    assert "Mitsuba would drop" in error_of(
        '<include filename="loose.xml"/>', folder=tmp_path
    )


def test_path_is_searched_first(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = '<shape type="obj"><string name="filename" value="t.obj"/></shape>'
    content = f'<path value="meshes"/>{mesh}'
    scene = ours(content, folder=tmp_path)
    assert (
        len(scene.shapes[0].faces)
        == theirs(content, folder=tmp_path).shapes()[0].face_count()
    )
    assert scene.files == (str(tmp_path / "meshes" / "t.obj"),)
    assert "the folder" in error_of('<path value="nowhere"/>', folder=tmp_path)
    inside = '<shape type="sphere"><path value="meshes"/></shape>'
    assert "<path> must stand directly" in error_of(inside, folder=tmp_path)


# --------------------------------------------------------- syntax and entities


def test_file_is_among_the_files_read(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(scene_text(""))
    scene = scene_file.read_file(path)
    assert scene.source == str(path)
    assert scene.files == (str(path),)


def test_missing_scene_file(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no such scene file"):
        scene_file.read_file(tmp_path / "none.xml")
    with pytest.raises(SceneError, match="no such scene file"):
        scene_file.read_file(tmp_path)


@pytest.mark.parametrize(
    "document",
    [
        '<?xml version="1.0"?>\n<!DOCTYPE s [<!ENTITY x "1">]>\n<scene '
        'version="3.0.0">&x;</scene>',
        '<?xml version="1.0"?>\n<!DOCTYPE s SYSTEM "file:///etc/passwd">\n<scene '
        'version="3.0.0"/>',
    ],
)
def test_entities_and_doctype_are_refused(document: str) -> None:
    with pytest.raises(
        SceneError, match="<string>:2: XML entities and DOCTYPE are not allowed"
    ):
        scene_file.read_string(document)


DOCUMENT = '<scene version="3.0.0">{}\n' + SENSOR + '<shape type="sphere"/>{}</scene>'


@pytest.mark.parametrize(
    "content",
    [
        DOCUMENT.format("<!-- a -- b --->", "<!------>").encode(),
        DOCUMENT.format("<!-- caf\xe9 \x01 -->", "").encode("latin-1"),
        b'\n <?xml version="1.0"?>' + DOCUMENT.format("", "").encode(),
        b'<?xml version="1.0" encoding="us-ascii"?>'
        + DOCUMENT.format("<!-- caf\xe9 -->", "").encode(),
        b'<?xml version="1.0" encoding="gb2312"?>'
        + DOCUMENT.format("<!-- \u4f60 -->", "").encode("gb2312"),
        DOCUMENT.format("", '<bsdf type="diffuse" id="a & b &c &#38; &lt;"/>').encode(),
        DOCUMENT.format("", "").encode("utf-16"),
        DOCUMENT.format("", "").encode("utf-16-le"),
        DOCUMENT.format("", "").encode("utf-8-sig"),
    ],
    ids=[
        *("dashes", "latin comment", "blank line", "not ascii", "chinese", "ampersands"),
        *("utf-16", "utf-16 without a mark", "utf-8 with a mark"),
    ],
)
def test_what_the_standard_forbids_and_mitsuba_takes(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "scene.xml"
    path.write_bytes(content)
    assert len(mi.load_file(str(path)).shapes()) == 1
    found = scene_file.read_file(path)
    assert len(found.shapes) == 1
    lines = content.count(b"\n") + 1
    assert found.shapes[0].location.line == lines


def test_comments_are_found_only_where_they_can_begin() -> None:
    """In a value and in CDATA the same characters are text; other quotes too."""
    name = "it's <!-- no comment"
    content = (
        f"<!-- \"one' --><![CDATA[<!-- two -->]]>it's\n"
        f'<shape type="sphere" id="{name.replace("<", "&lt;")} -->"/><!-- "three -->'
    )
    (shape,) = ours(content).shapes
    assert (shape.id, shape.location.line) == (f"{name} -->", 3)
    assert "not well-formed" in error_of(f'<shape type="sphere" id="{name} -->"/>')


@pytest.mark.parametrize(
    ("encoding", "found"),
    [
        ("utf-7", "the encoding utf-7 is not supported"),  # no markup in ASCII
        ("raw_unicode_escape", "the encoding raw_unicode_escape is not supported"),
        ("cp037", "the encoding cp037 is not supported"),
        ("rot13", "the encoding rot13 is not supported"),
        ("klingon", "unknown encoding: klingon"),
        ("utf-8", "'utf-8' codec can't decode byte 0xe9"),
    ],
)
def test_encodings_that_are_refused(tmp_path: Path, encoding: str, found: str) -> None:
    path = tmp_path / "scene.xml"
    declaration = f'<?xml version="1.0" encoding="{encoding}"?>'.encode()
    path.write_bytes(declaration + b'<scene version="3.0.0" id="\xe9"/>')
    with pytest.raises(SceneError) as error:
        scene_file.read_file(path)
    assert str(error.value).startswith(f"{path}:1: cannot decode the XML file: {found}")


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (
            '<scene version="3.0.0">\n<shape></scene>',
            "<string>:2: not well-formed XML: mismatched",
        ),
        ("", "<string>:1: not well-formed XML: no element found"),
        ("not xml", "<string>:1: not well-formed XML"),
        ("<scene>&amp;&lol;</scene>", "<string>:1: not well-formed XML: undefined entity"),
        ("<scene/>", '<string>:1: <scene> lacks the attribute "version"'),
        (
            '<scene version="three"/>',
            '<string>:1: version is "three"; expected three numbers',
        ),
        (
            '<bsdf version="3.0.0" type="diffuse"/>',
            '<string>:1: the root is bsdf "diffuse"',
        ),
        (
            "<a>" * 150 + "</a>" * 150,
            "<string>:1: more than 100 elements inside each other",
        ),
    ],
)
def test_documents_that_are_no_scene(document: str, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene_file.read_string(document)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "<shap/>",
            "the element <shap> is not supported; supported: alias, boolean, bsdf,",
        ),
        ("<translate/>", "<translate> belongs inside a <transform>"),
        (
            '<shape type="sphere" colour="x"/>',
            '<shape> has no attribute "colour"; it takes: id,',
        ),
        ("<shape/>", '<shape> lacks the attribute "type"'),
        ('<float name="x"/>', '<float> lacks the attribute "value"'),
        (
            '<float name="x" value="1"><float name="y" value="2"/></float>',
            "takes no elements",
        ),
        ('<boolean name="x" value="yes"/>', 'boolean "x" is "yes"; expected true or false'),
        ('<integer name="x" value="1.5"/>', 'integer "x" is "1.5"; expected an integer'),
        (props(x=99999999999999999999), "too large for a 64-bit integer"),
        ('<float name="x" value="1_0"/>', 'float "x" is "1_0"; expected a finite number'),
        ('<point name="x" x="1"/>', "<point> needs x, y and z"),
        (tag("point", x="1 2"), "2 numbers; expected 1 or 3"),
        ('<point name="x" value="1" y="1"/>', 'has "value" and "y"'),
        (
            '<shape type="sphere"><field type="grid" name="interior"/></shape>',
            'shape "sphere" refers to field "grid"; this renderer has no field',
        ),
        (props(gamma=1.0), 'scene has no property "gamma"; supported: '),
        ('<alias id="a" as="b"/>', '<alias> of "a", which is no id so far'),
    ],
)
def test_elements_that_are_wrong(content: str, message: str) -> None:
    assert error_of(content).startswith("<string>:2: ")
    assert message in error_of(content)
    if "1_0" not in content and "field" not in content:
        assert mitsuba_refuses(content)


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e999", "1e39", "infinity"])
def test_numbers_that_are_not_finite_are_refused_everywhere(number: str) -> None:
    """Mitsuba takes most of these, and renders NaN."""
    for content in (
        f'<shape type="sphere"><float name="radius" value="{number}"/></shape>',
        f'<shape type="sphere"><point name="center" x="0" y="{number}" z="0"/></shape>',
        f'<emitter type="point"><rgb name="intensity" value="{number}"/></emitter>',
        f'<emitter type="point"><spectrum name="intensity" value="{number}"/></emitter>',
        '<emitter type="point"><spectrum name="intensity" value="4:1 '
        f'5:{number}"/></emitter>',
        '<shape type="sphere"><transform name="to_world">'
        f'<translate x="{number}"/></transform></shape>',
        '<shape type="sphere"><transform name="to_world">'
        f'<rotate x="1" angle="{number}"/></transform></shape>',
    ):
        assert "finite number" in error_of(content)


def test_text_between_elements_is_mentioned_in_the_log() -> None:
    scene = ours('<shape type="sphere">oops</shape>')
    assert scene.warnings == ('<string>:2: text inside <shape>: "oops"',)


def test_comments_and_processing_instructions_are_skipped() -> None:
    assert ours("<!-- a -->\n<?x y?>").warnings == ()


# --------------------------------------------------------------- old versions


def test_version_below_2_has_other_names(tmp_path: Path) -> None:
    """Camel case becomes snake case, and the four uv numbers a transform; as in Mitsuba."""
    content = (
        '<shape type="rectangle"><transform name="toWorld"><scale value="2"/></transform>'
        '<bsdf type="diffuse"><texture type="checkerboard" name="diffuseReflectance">'
        '<float name="uscale" value="4"/><float name="voffset" '
        'value="0.5"/></texture></bsdf>'
        "</shape>"
        '<shape type="sphere"><bsdf type="dielectric"><float name="intIOR" '
        'value="1.25"/></bsdf>'
        "</shape>"
    )
    scene = ours(content, version="0.6.0")
    reference = theirs(content, version="0.6.0")
    assert scene.shapes[0].to_world[0, 0] == 2.0 == reference.shapes()[0].bbox().max[0]
    board = mi.traverse(reference.shapes()[0].bsdf())
    np.testing.assert_allclose(
        scene.shapes[0].bsdf.reflectance.to_uv, np.array(board["reflectance.to_uv"].matrix)
    )
    eta = mi.traverse(reference.shapes()[1].bsdf())["eta"]
    assert scene.shapes[1].bsdf.eta == pytest.approx(eta, rel=1e-6)
    assert 'no property "diffuseReflectance"' in error_of(content, version="2.0.0")
    assert mitsuba_refuses(content, version="2.0.0")


OLD_UV = {"uscale": 4.0, "vscale": -0.5, "uoffset": 0.25, "voffset": 0.75}


@pytest.mark.parametrize(
    "names",
    [c for n in range(1, 5) for c in itertools.combinations(OLD_UV, n)]
    + [("voffset", "uscale", "uoffset", "vscale")],  # their order in the file means nothing
    ids=" ".join,
)
def test_old_uv_numbers_are_mitsubas_transform(names: tuple[str, ...]) -> None:
    """All subsets of four numbers that differ: scale and shift do not commute, nor u and v.

    The shift comes first: u is scale (u + offset).
    """
    numbers = "".join(f'<float name="{name}" value="{OLD_UV[name]}"/>' for name in names)
    content = (
        '<shape type="rectangle"><bsdf type="diffuse"><texture type="checkerboard" '
        f'name="reflectance">{numbers}</texture></bsdf></shape>'
    )
    board = mi.traverse(theirs(content, version="0.6.0").shapes()[0].bsdf())
    to_uv = ours(content, version="0.6.0").shapes[0].bsdf.reflectance.to_uv
    np.testing.assert_allclose(to_uv, np.array(board["reflectance.to_uv"].matrix))
    given = {name: OLD_UV[name] for name in names}
    for axis, letter in enumerate("uv"):
        factor, offset = given.get(f"{letter}scale", 1.0), given.get(f"{letter}offset", 0.0)
        assert to_uv[axis, axis] == factor, f"{letter}: {to_uv}"
        assert to_uv[axis, 2] == factor * offset, f"{letter}: {to_uv}"


def test_version_below_2_refuses_uv_numbers_of_another_type() -> None:
    content = (
        '<shape type="disk"><bsdf type="diffuse"><texture type="checkerboard" '
        'name="reflectance">\n<string name="uscale" value="4"/></texture></bsdf></shape>'
    )
    message = error_of(content, version="1.0.0")
    assert message == (
        '<string>:3: texture "checkerboard", property "uscale": found a string, '
        "expected a float"
    )


# -------------------------------------------------------------------- the scene


def test_default_bsdf_is_grey_and_black_on_lights() -> None:
    """Mitsuba's default is 0.5, but 0 on a shape with an emitter."""
    content = '<shape type="sphere"/><shape type="disk"><emitter type="area"/></shape>'
    scene = ours(content)
    for shape, reference in zip(scene.shapes, theirs(content).shapes(), strict=True):
        grey = mi.traverse(reference.bsdf())["reflectance.value"]
        assert shape.bsdf.reflectance == ConstantTexture((grey, grey, grey))
    assert isinstance(scene.shapes[0].bsdf, Diffuse)


def test_scene_without_sensor_or_with_two() -> None:
    assert error_of("", sensor="").startswith("<string>:1: the scene has no <sensor>")
    two = ours("", sensor=SENSOR + SENSOR.replace("40", "50"))
    assert two.camera.fov_x == 40.0
    assert "2 sensors; the first one takes the picture" in two.warnings[0]


def test_second_integrator_and_second_environment() -> None:
    content = '<integrator type="path"/>\n<integrator type="direct"/>'
    assert error_of(content).startswith("<string>:3: a second <integrator> in scene")
    assert mitsuba_refuses(content)
    content = '<emitter type="constant"/>\n<emitter type="constant"/>'
    assert error_of(content).startswith(
        '<string>:3: emitter "constant" is a second environment, after line 2'
    )
    assert mitsuba_refuses(content)


def test_what_only_waits_for_references_is_checked_too() -> None:
    """Mitsuba makes an object of each, used or not. (Unsupported: test_unused_parts.)"""
    for content in (
        '<texture type="bitmap"/>',
        element("texture", "uniform", valu=1.0),
        element("film", "hdrfilm", width=0),
        element("rfilter", "tent", radiu=1.0),
    ):
        assert error_of(content).startswith("<string>:2: ")


def test_robust_intersections_flag_is_known() -> None:
    flag = props(embree_use_robust_intersections=True)
    assert ours(flag).warnings == ()
    theirs(flag)
