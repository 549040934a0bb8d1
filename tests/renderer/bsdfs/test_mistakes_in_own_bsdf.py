"""Mistakes in a user's BSDF end in one line: FILE:LINE, what is wrong, what to write.

Each is a small edit of tests/own_bsdf.py. It is found before the large kernels are
compiled, so that a case takes a tenth of a second.
"""

from __future__ import annotations

import dataclasses
import importlib
import re
import sys
import uuid
from pathlib import Path

import pytest

import renderer
from mitsuba_ref.command.cli import main as validate_command
from mitsuba_ref.command.verdict_of_error import stopped_by
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import NO_PROOF
from mitsuba_ref.records.verdicts import VERDICTS
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.command.cli import main as render_command
from renderer.errors import PluginError
from renderer.plugins.bsdfs.parameters import Color, Float, hints_of
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.plugins.sampling.numbers_and_warps import Plain, along_u
from renderer.rendering.user_kernels import check
from renderer.rendering.user_kernels.check import check_kernels_of, check_kernels_of_users
from renderer.rendering.user_kernels.diagnosis import explain
from renderer.rendering.user_kernels.remedies import INSTEAD
from renderer.scene_file import plugins as plugin_file

TESTS = Path(__file__).parents[2]
RIGHT = (TESTS / "own_bsdf.py").read_text()
SCENE = TESTS / "own_bsdf.xml"

# lines of the right file, in the place of which each mistake stands
COS_I = "    cos_i = select(wi.z > 0.0, wi.z, 0.0)\n"
EVALUATED = "    return f_cos, INV_PI * cos_i\n"
DRAWN = "    wi = cosine_direction(numbers.arithmetic, numbers.x, numbers.y)\n"
SAMPLED = "    return BsdfSample(wi, weight, INV_PI * wi.z, splat_f32(1.0))\n"
RETURNED = "return BsdfSample("
SHOWN = "    return lunar.albedo\n\n"
CONSTANT = "INV_PI = np.float32(1.0 / np.pi)\n"
REGISTERED = (
    '    "lunar", Lunar, sample=sample, eval_pdf=eval_pdf, albedo=albedo, '
    'about="Moon dust"\n'
)
DECORATED = "@renderer.kernel\ndef albedo("
TWIN = "def register_mitsuba():"
KERNELS = ("sample", "eval_pdf", "albedo")
PARAMETER = "    albedo: Color = 0.3  # of a single grain\n"
MORE = """\
import math
from renderer.kernels.lanes import functions
from renderer.kernels.lanes.functions import *
from renderer.kernels.lanes.mathematics import power
from renderer.kernels.lanes.mathematics import sincos
from renderer.kernels.lanes.vectors import dot, vec3
from renderer.plugins.bsdfs.kind import Float
TABLE = {"a": 1.0}
"""


@pytest.fixture(autouse=True)
def registers(monkeypatch):
    """Leave the registers of this process as they were."""
    before, modules = dict(BSDFS), set(sys.modules)
    files = dict(plugin_file.registered_by)
    monkeypatch.setattr(plugin_file, "imported", [])
    yield
    plugin_file.registered_by.clear()
    plugin_file.registered_by.update(files)
    BSDFS.clear()
    BSDFS.update(before)
    for name in set(sys.modules) - modules:
        if name.startswith("lightproof_plugins_") or name == "own_helper":
            del sys.modules[name]


def written(folder, old, new, more=MORE):
    """Write the right file with one edit, and more imports; return its path and text."""
    assert RIGHT.count(old) == 1, old
    text = RIGHT.replace(old, new).replace(CONSTANT, more + CONSTANT)
    path = folder / "mine.py"
    path.write_text(text)
    return path, text


def line_of(text, part):
    """Return the line of a file that has a part, the last of several."""
    assert part in text, part
    return text[: text.rindex(part)].count("\n") + 1


def said_of(path):
    """Return what is said about a plugin file, after it is imported or when it is used."""
    with pytest.raises(PluginError) as caught:
        plugin_file.import_plugin_file(str(path))
        check_kernels_of_users([BSDFS["lunar"]], Plain())
    return one_line(str(caught.value))


def one_line(said):
    """Return a message, which must have one line and nothing of Numba's."""
    assert "\n" not in said
    assert not re.search(r"report it|Traceback|Numba|0x[0-9a-f]{6}|\$", said), said
    return said


def said_by_command(path, capsys, scene=SCENE):
    """Return the one line that the command says about a plugin file."""
    output = Path(f"{path}.npy")
    options = ["--plugins", str(path), "--spp", "1", "-o", str(output), "--quiet"]
    status = render_command([str(scene), *options])
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert status == 1 and len(lines) == 1, captured.err
    assert not captured.out and not output.exists()
    assert lines[0].startswith("error: ")
    return one_line(lines[0].removeprefix("error: "))


def each_lane(new, said):
    """Return a mistake in the line that computes cos_i."""
    return COS_I, f"    cos_i = {new}\n", new, said


# (line of the right file, what stands there, part of the line that is named, what is said)
IN_KERNELS = {
    # a branch on lanes
    "if": (COS_I, "    cos_i = wi.z\n    if wi.z <= 0.0:\n        cos_i = 0.0 * wo.z\n",
           "if wi.z <= 0.0:", ("`if`", "select(mask, yes, no)")),
    "while": (COS_I, COS_I + "    while cos_i > 1.0:\n        cos_i = cos_i * 0.5\n",
              "while cos_i", ("`while`", "select")),
    "if expression": each_lane("wi.z if wi.z > 0.0 else wo.z", ("`if`", "select")),
    "and": each_lane("select(wi.z > 0.0 and wo.z > 0.0, wi.z, 0.0)", ("`and`", "&")),
    "or": each_lane("select(wi.z > 0.0 or wo.z > 0.0, wi.z, 0.0)", ("`or`", "|")),
    "not": each_lane("select(not wi.z < 0.0, wi.z, 0.0)", ("`not`", "~")),
    "chain": each_lane("select(0.0 < wi.z < 1.0, wi.z, 0.0)", ("(a < x) & (x < b)",)),
    "parentheses": each_lane("select(wi.z > 0.0 & wo.z > 0.0, wi.z, 0.0)", ("parenthes",)),
    "no comparison": each_lane("select(wi.z, wi.z, 0.0)", ("needs a mask", "x > 0.0")),
    # what Python, math and NumPy have for numbers
    "max": each_lane("max(wi.z, 0.0)", ("max() of 16 lanes", "maximum(a, b)", "functions")),
    "min": each_lane("min(wi.z, 1.0)", ("minimum(a, b)",)),
    "abs": each_lane("abs(wi.z)", ("fabs(x)",)),
    "round": each_lane("round(wi.z)", ("floor(x + 0.5)",)),
    "float": each_lane("float(wi.z)", ("float() of 16 lanes", "to_f32")),
    "int": each_lane("int(wi.z)", ("to_i32(x)",)),
    "pow": each_lane("pow(wi.z, 2.0)", ("power(x, splat_f32(2.0))", "lanes.mathematics)")),
    "**": each_lane("wi.z ** 2", ("`**` of 16 lanes", "x * x")),
    "%": each_lane("wi.z % 2.0", ("floor(x / y)",)),
    "//": each_lane("wi.z // 2.0", ("floor(x / y)",)),
    "sum": each_lane("sum((wi.x, wi.z))", ("a + b + c",)),
    "math.sqrt": each_lane("math.sqrt(wi.z)", ("sqrt(x) (renderer.kernels.lanes.funct",)),
    "math.cos": each_lane("math.cos(wi.z)", ("sincos(x)", "mathematics")),
    "np.exp": each_lane("np.exp(wi.z)", ("exp(x)", "lanes.mathematics)")),
    "np.where": each_lane("np.where(wi.z > 0.0, wi.z, 0.0)", ("select(mask, yes, no)",)),
    "np.dot": each_lane("np.dot(wi, wo)", ("dot(a, b)", "vectors")),
    "np.clip": each_lane("np.clip(wi.z, 0.0, 1.0)", ("minimum(maximum(x, low), high)",)),
    "np.zeros": (COS_I, COS_I + "    t = np.zeros(3)\n    cos_i = cos_i * t[0]\n",
                 "np.zeros", ("makes no arrays",)),
    "np.float32": each_lane("np.float32(wi.z)", ("float32() of 16 lanes",)),
    "np.random": each_lane("wi.z * np.random.rand()", ("random numbers", "numbers.x")),
    "range": (COS_I, COS_I + "    for k in range(wi.z):\n        cos_i = cos_i * 0.5\n",
              "range(", ("range() of 16 lanes", "whole number")),
    # names and fields
    "field": (SHOWN, "    return lunar.albdo\n\n", "lunar.albdo",
              ("no field 'albdo'", "did you mean albedo")),
    "component": each_lane("wi.w", ("no .w", "x, y and z")),
    "red": each_lane("lunar.albedo.r", ("no .r", "use x")),
    "method": each_lane("wi.dot(wo)", ("no .dot", "dot(a, b)")),
    "numbers": (DRAWN, DRAWN.replace("numbers.x", "numbers.u"), "numbers.u",
                ("Numbers", "x, y, choice")),
    "component of lanes": each_lane("wi.z.x", ("16 lanes", ".x")),
    "index": each_lane("wi[2]", ("`[]`", ".x, .y and .z")),
    "lane": each_lane("wi.z[0]", ("`[]` of 16 lanes", "no index")),
    "name": each_lane("slect(wi.z > 0.0, wi.z, 0.0)", ("slect", "did you mean select")),
    "not imported": each_lane("erf(wi.z)", ("from renderer", "mathematics import erf")),
    "name in a module": each_lane("functions.sqart(wi.z)", ("did you mean sqrt",)),
    "name in NumPy": each_lane("np.sqart(wi.z)", ("numpy has no sqart", "sqrt")),
    "no value yet": each_lane("cos_i * 2.0", ("cos_i", "before it has a value")),
    "dictionary outside": each_lane('wi.z * TABLE["a"]', ("TABLE is a dict",)),
    # arguments
    "too few": (DRAWN, DRAWN.replace(", numbers.y", ""), "cosine_direction(numbers",
                ("cosine_direction(arithmetic, x, y)", "'y'")),
    "too many": each_lane("dot(wi, wo, wo)", ("dot(a, b)", "too many")),
    "of an intrinsic": each_lane("select(wi.z > 0.0, wi.z)", ("select(mask, yes, no)",)),
    "unknown keyword": (SAMPLED, "    return BsdfSample(wi, weight, wi.z, etta=wi.z)\n",
                        "etta", ("no 'etta'", "did you mean eta")),
    "too few fields": (SAMPLED, "    return BsdfSample(wi, weight, wi.z)\n", RETURNED,
                       ("BsdfSample(wi, weight, pdf, eta", "'eta'")),
    "number for a vector": each_lane("dot(wi, 1.0)", ("dot is given one number", ".x")),
    "number for lanes": each_lane("power(wi.z, 2.0)", ("the kernel power", "splat_f32(x)")),
    "vector for a number": each_lane("maximum(wi, 0.0).z", ("a vector", "components")),
    "select of vectors": each_lane("select(wi.z > 0.0, wi, wo).z", ("select3",)),
    "vec3": each_lane("vec3(wi, 0.0, 0.0).z", ("vec3 takes three",)),
    "whole number": each_lane("sqrt(2) * wi.z", ("sqrt needs floats", "2.0")),
    "splat of lanes": each_lane("splat_f32(wi.z)", ("it is lanes already",)),
    "a call of lanes": each_lane("wi.z(wo.z)", ("16 lanes cannot be called",)),
    # types that do not go together
    "mask times lanes": each_lane("(wi.z > 0.0) * wi.z", ("no number", "select(mask, x")),
    "mask plus mask": each_lane("(wi.z > 0.0) + (wo.z > 0.0)", ("&, | and ~",)),
    "vector in comparison": each_lane("wi > 0.0", ("compare components",)),
    "text": each_lane("wi.z + 'a'", ("text",)),
    "none": each_lane("wi.z * None", ("None is no number",)),
    "precisions": each_lane("to_double(wi.z) * wo.z", ("to_single",)),
    "pair": each_lane("sincos(wi.z) * 2.0", ("sine, cosine = sincos(x)",)),
    "vector +=": (COS_I, "    wi += wo\n" + COS_I, "wi += wo", ("a = a + b",)),
    "field set": (COS_I, "    wi.z = wo.z\n" + COS_I, "wi.z = wo.z", ("vec3(x, y, z)",)),
    "unpacked": (COS_I, "    a, b, cos_i = wi\n", "= wi", (".x, .y and .z",)),
    "three of two": (COS_I, "    a, b, cos_i = sincos(wi.z)\n", "sincos", ("3 names", "2")),
    "two types": (COS_I, "    cos_i = 0.0\n    for k in range(3):\n        cos_i += wi.z\n",
                  "for k", ("cos_i is one number", "splat_f32(0.0)")),
    # what kernels have not
    "list": each_lane("[wi.z, wo.z][0]", ("lists", "tuples")),
    "comprehension": (COS_I, COS_I + "    t = [wi.z for k in range(3)]\n", "t = [",
                      ("lists",)),
    "dict": (COS_I, COS_I + "    t = {'a': wi.z}\n", "t = {", ("dictionaries",)),
    "print": (COS_I, COS_I + "    print(wi.z)\n", "print(", ("cannot print",)),
    "f-string": (COS_I, COS_I + "    t = f'{INV_PI}'\n", "t = f", ("f-strings",)),
    "raise": (COS_I, COS_I + "    raise ValueError('x')\n", "raise", ("cannot raise",)),
    "assert": (COS_I, COS_I + "    assert INV_PI > 0.0\n", "assert", ("cannot assert",)),
    "try": (COS_I, "    try:\n    " + COS_I + "    except Exception:\n        pass\n",
            "try:", ("`try`",)),
    "with": (COS_I, "    with wi:\n    " + COS_I, "with wi", ("`with`",)),
    "import": (COS_I, "    import math\n" + COS_I, "    import math", ("cannot import",)),
    "class": (COS_I, COS_I + "    class A:\n        pass\n", "class A", ("class",)),
    "recursion": (EVALUATED, "    return eval_pdf(lunar, wo, wi)\n", "def eval_pdf",
                  ("cannot call itself",)),
    "yield": (EVALUATED, "    yield f_cos, cos_i\n", "yield", ("`yield`",)),
    # what is returned
    "pdf a number": (SAMPLED, SAMPLED.replace("INV_PI * wi.z", "INV_PI"), RETURNED,
                     ("returns as pdf one number", "16 lanes", "splat_f32(x)")),
    "eta a number": (SAMPLED, SAMPLED.replace("splat_f32(1.0)", "1.0"), RETURNED,
                     ("returns as eta one number", "splat_f32(x)")),
    "weight lanes": (SAMPLED, SAMPLED.replace("weight", "wi.z"), RETURNED,
                     ("returns as weight 16 lanes", "vec3(x, x, x)")),
    "weight a number": (SAMPLED, SAMPLED.replace("weight", "0.5"), RETURNED,
                        ("returns as weight one number", "vec3(splat_f32(x)")),
    "wi of numbers": (SAMPLED, SAMPLED.replace("wi,", "vec3(0.0, 0.0, 1.0),"),
                      RETURNED, ("returns as wi a vector of one", "splat_f32")),
    "pdf a vector": (SAMPLED, SAMPLED.replace("INV_PI * wi.z", "wi"), RETURNED,
                     ("returns as pdf a vector", "v.z")),
    "pdf a mask": (SAMPLED, SAMPLED.replace("INV_PI * wi.z", "wi.z > 0.0"),
                   RETURNED, ("returns as pdf a mask", "select(mask")),
    "pdf whole": (SAMPLED, SAMPLED.replace("INV_PI * wi.z", "to_i32(wi.z)"),
                  RETURNED, ("returns as pdf 16 lanes of int32", "to_f32(x)")),
    "pdf double": (SAMPLED, SAMPLED.replace("INV_PI * wi.z", "to_double(wi.z)"),
                   RETURNED, ("as pdf 16 lanes of float64", "to_single(x)")),
    "a field in its line": (
        SAMPLED, "    return BsdfSample(\n        wi,\n        weight,\n"
        "        INV_PI,\n        wi.z,\n    )\n",
        "        INV_PI,", ("returns as pdf one number",)),
    "tuple": (SAMPLED, "    return wi, weight, wi.z, wi.z\n", "return wi, w",
              ("BsdfSample(wi, weight, pdf, eta) is needed",)),
    "no return": (SAMPLED, SAMPLED.replace("return ", ""), "def sample",
                  ("returns nothing", "is there a `return`?")),
    "value alone": (EVALUATED, "    return f_cos\n", "return f_cos",
                    ("returns a vector", "the density")),
    "swapped": (EVALUATED, "    return INV_PI * cos_i, f_cos\n", "return INV_PI",
                ("returns as f |cos| 16 lanes",)),
    "density a number": (EVALUATED, "    return f_cos, INV_PI\n", "return f_cos",
                         ("returns as the density one number", "splat_f32(x)")),
    "three values": (EVALUATED, "    return f_cos, cos_i, cos_i\n", "return f_cos",
                     ("returns 3 values",)),
    "none on one way": (
        EVALUATED, "    for k in range(3):\n        return f_cos, cos_i\n", "return f_cos",
        ("does not return anything on one of its ways",)),
    "two ways": (EVALUATED, "    for k in range(3):\n        return f_cos\n" + EVALUATED,
                 "        return f_cos\n", ("returns a vector", "in line", "a tuple")),
    "albedo lanes": (SHOWN, "    return lunar.albedo.x\n\n", "return lunar.albedo.x",
                     ("albedo of BSDF 'lunar' returns 16 lanes", "vec3(x, x, x)")),
    "albedo a number": (SHOWN, "    return 0.5\n\n", "return 0.5", ("returns one number",)),
}  # fmt: skip


@pytest.mark.parametrize("mistake", IN_KERNELS.values(), ids=IN_KERNELS)
def test_a_mistake_in_a_kernel_is_one_line_with_its_place(tmp_path, mistake):
    old, new, at, said = mistake
    path, text = written(tmp_path, old, new)
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, at)}: ")
    assert all(word in line for word in said), line
    assert len(line.removeprefix(str(path))) < 300


@pytest.mark.parametrize("module", sorted({module for _, module in INSTEAD.values()}))
def test_what_is_to_be_written_can_be_compiled(tmp_path, module):
    """Each remedy as it stands, with the names of the module that it says."""
    given = [write for write, of in INSTEAD.values() if of == module]
    code = [re.split(", or |, then ", write)[0] for write in given]
    body = "".join(f"    r{k} = {one}\n" for k, one in enumerate(code) if one != "x itself")
    imports = "from renderer.kernels.lanes.functions import splat_f32\n"
    if module:
        imports += f"from {module} import *\n"
        found = vars(importlib.import_module(module))
        assert all(set(re.findall(r"(\w+)\(", write)) & set(found) for write in given)
    a_and_b = "wi, wi" if module.endswith("vectors") else "wi.x, wi.y"
    path = tmp_path / "remedies.py"
    path.write_text(
        f"import math\nimport renderer\n{imports}\n\n@renderer.kernel\ndef remedies(wi):\n"
        f"    x, y, c = wi.x, wi.y, wi.z\n    a, b = {a_and_b}\n"
        f"    low, high, yes, no, mask = x, y, x, y, x > y\n{body}    return x\n"
    )
    plugin_file.import_plugin_file(str(path)).remedies.compile((check.VECTOR,))


# ------------------------------------------------------- before a kernel is compiled

# (line of the right file, what stands there, part of the line that is named, what is said)
AT_IMPORT = {
    "syntax": (COS_I, COS_I.replace("0.0)\n", "0.0\n"), "cos_i = select(",
               ("SyntaxError",)),
    "indentation": (COS_I, "  " + COS_I, "cos_i = select", ("IndentationError",)),
    "division": (CONSTANT, CONSTANT + "A = 1 / 0\n", "A = 1 / 0", ("ZeroDivisionError",)),
    "module": (CONSTANT, "import no_such\n" + CONSTANT, "import no_such",
               ("ModuleNotFoundError", "no_such")),
    "name of a module": (
        CONSTANT, "from renderer.kernels.lanes.functions import selct\n" + CONSTANT,
        "import selct", ("cannot import name 'selct'", "did you mean select?")),
    "decorator": (DECORATED, DECORATED.replace("kernel", "kernal"), "@renderer.kernal",
                  ("no attribute 'kernal'", "did you mean kernel?")),
    "end of the process": (CONSTANT, CONSTANT + "raise SystemExit(3)\n", "SystemExit",
                           ("SystemExit: 3",)),
    "undecorated": (DECORATED, "def albedo(", "def albedo", ("'albedo' is no kernel",)),
    "no sample": (REGISTERED, REGISTERED.replace("sample=sample, ", ""),
                  "renderer.register_bsdf(", ("missing", "'sample'")),
    "sample is none": (REGISTERED, REGISTERED.replace("=sample", "=None"),
                       "renderer.register_bsdf(", ("has no sample",)),
    "unknown argument": (REGISTERED, REGISTERED.replace("eval_pdf=", "evalpdf="),
                         "renderer.register_bsdf(", ("'evalpdf'",)),
    "too few arguments": (REGISTERED, REGISTERED.replace("=sample", "=albedo"),
                          "def albedo", ("albedo(lunar)", "sample(parameters, wo, numb")),
    "too many arguments": (REGISTERED, REGISTERED.replace("=albedo", "=sample"),
                           "def sample", ("albedo(parameters, wo), or without wo",)),
    "no class": (REGISTERED, REGISTERED.replace("Lunar", "Lunar(0.3)"),
                 "renderer.register_bsdf(", ("no NamedTuple class but Lunar(",)),
    "no name": (REGISTERED, REGISTERED.replace('"lunar", ', '"", '),
                "renderer.register_bsdf(", ("the name of a BSDF",)),
    "annotation": (PARAMETER, "    albedo: float = 0.3\n", "class Lunar",
                   ("neither Color nor Float", "float")),
    "default NaN": (PARAMETER, '    albedo: Color = float("nan")\n', "class Lunar",
                    ("default of albedo is nan", "finite number of 0 or more")),
    "default below 0": (PARAMETER, "    albedo: Color = -0.5\n", "class Lunar",
                        ("default of albedo is -0.5", "0 or more")),
    "default too large": (PARAMETER, "    albedo: Color = 10**400\n", "class Lunar",
                          ("default of albedo is 1000", "finite number")),
    "default": (PARAMETER, '    albedo: Color = "red"\n', "class Lunar",
                ("default of albedo is 'red'", "number")),
    "name of a parameter": (PARAMETER, PARAMETER + "    values: Float = 1.0\n",
                            "class Lunar", ("'values'", "another name")),
    "twice": (TWIN, "class Other(NamedTuple):\n    albedo: Color = 0.3\n\n\n"
              "renderer.register_bsdf('lunar', Other, sample=sample, eval_pdf=eval_pdf)"
              "\n\n\n" + TWIN, "renderer.register_bsdf('lunar', Other",
              ("registered twice", "Lunar", "Other")),
    "read is no function": (REGISTERED, REGISTERED[:-1] + ", read=3\n",
                            "renderer.register_bsdf(", ("read is 3",)),
}  # fmt: skip


@pytest.mark.parametrize("mistake", AT_IMPORT.values(), ids=AT_IMPORT)
def test_a_mistake_at_import_is_one_line_with_its_place(tmp_path, mistake):
    old, new, at, said = mistake
    path, text = written(tmp_path, old, new)
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, at)}: ")
    assert all(word in line for word in said), line


def test_a_scene_says_what_a_plugin_file_registers(tmp_path, capsys):
    """No call of `register_bsdf`, or one with another name: the scene's line says so."""
    call = RIGHT[RIGHT.index("renderer.register_bsdf(") : RIGHT.index("\n\n\ndef register")]
    for text, said in (
        (RIGHT.replace(call, ""), "mine.py registers no BSDF, as it does not call"),
        (RIGHT.replace('"lunar", Lunar', '"lunr", Lunar'), "mine.py registers 'lunr'"),
    ):
        path = tmp_path / "mine.py"
        path.write_text(text)
        plugin_file.import_plugin_file.cache_clear()
        line = said_by_command(path, capsys)
        assert line.startswith(f"{SCENE}:") and said in line


READS = {
    "raises": ("    return {}['albedo']\n", "return {}", "KeyError: 'albedo'"),
    "nothing": ("    pass\n", "def read", "returned None"),
    "no parameter": ("    return OtherBsdf('lunar', {})\n", "def read", "no 'albedo'"),
    "text": ("    return OtherBsdf('lunar', {'albedo': 'red'})\n", "def read", "is 'red'"),
}


@pytest.mark.parametrize("mistake", READS.values(), ids=READS)
def test_a_mistake_in_read_is_one_line_with_both_places(tmp_path, capsys, mistake):
    body, at, said = mistake
    more = (
        "from renderer.scene_file.description import OtherBsdf\n\n\n"
        f"def read(properties):\n{body}\n\n"
    )
    path, text = written(tmp_path, REGISTERED, REGISTERED[:-1] + ", read=read\n", more)
    line = said_by_command(path, capsys)
    assert line.startswith(f"{path}:{line_of(text, at)}: ")
    assert "own_bsdf.xml:" in line and said in line


# --------------------------------------------------------------- where the mistake is

HELPER = """\
import renderer


@renderer.kernel
def clamped(x):
    twice = x * 2.0
    return max(twice, 0.0)
"""
OVERLOADED = """\
from numba.extending import overload


def clamped(x):
    pass


@overload(clamped)
def _clamped(x):
    def implementation(x):
        return max(x, 0.0)

    return implementation


"""


def test_the_line_is_that_of_another_file_of_the_users(tmp_path):
    helper = tmp_path / "own_helper.py"
    helper.write_text(HELPER)
    path, _ = written(
        tmp_path, COS_I, "    cos_i = clamped(wi.z)\n", "from own_helper import clamped\n"
    )
    assert said_of(path).startswith(f"{helper}:{line_of(HELPER, 'max(')}: clamped: max()")


def test_a_statement_of_another_file_of_the_users_is_named_there(tmp_path):
    helper = tmp_path / "own_helper.py"
    text = HELPER.replace("    return max(twice, 0.0)", "    print(twice)\n    return x")
    helper.write_text(text)
    path, _ = written(
        tmp_path, COS_I, "    cos_i = clamped(wi.z)\n", "from own_helper import clamped\n"
    )
    assert said_of(path).startswith(f"{helper}:{line_of(text, 'print(')}: clamped: ")


def test_the_line_is_that_of_an_overload(tmp_path):
    path, text = written(tmp_path, COS_I, "    cos_i = clamped(wi.z)\n", OVERLOADED)
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, 'max(x, 0.0)')}: ")
    assert "maximum(a, b)" in line


def test_a_function_that_is_no_kernel_is_named_where_it_is_called(tmp_path):
    more = "def clamped(x):\n    return x\n\n\n"
    path, text = written(tmp_path, COS_I, "    cos_i = clamped(wi.z)\n", more)
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, 'clamped(wi.z)')}: ")
    assert "clamped is no kernel; decorate it with renderer.kernel" in line


def test_two_kernels_that_call_each_other_are_named(tmp_path):
    more = (
        "@renderer.kernel\ndef there(x):\n    return back(x)\n\n\n"
        "@renderer.kernel\ndef back(x):\n    return there(x)\n\n\n"
    )
    path, _ = written(tmp_path, COS_I, "    cos_i = there(wi.z)\n", more)
    assert "cannot call itself, as it does through " in said_of(path)


@pytest.mark.filterwarnings("ignore:BSDF .lunar.. reflection:FutureWarning")
def test_branches_of_delta_lobes_are_checked_too(tmp_path):
    """`reflection` returns a `Branch`: whichever integrator renders, before it does."""
    more = (
        "from renderer.plugins.bsdfs.kind import Branch\n\n\n@renderer.kernel\n"
        "def reflection(lunar, wo):\n    return Branch(lunar.albedo, 1.0, wo.z, wo.z)\n\n\n"
    )
    changed = REGISTERED[:-1] + ", reflection=reflection\n"
    path, text = written(tmp_path, REGISTERED, changed, more)
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, 'return Branch(')}: reflection of BSDF")
    assert "returns as share one number" in line and "splat_f32(x)" in line


def test_a_delta_bsdf_whose_sample_names_no_lobe_is_refused(tmp_path):
    """Its mirrors would count as smooth, and their light be weighed by a density."""
    path, text = written(tmp_path, REGISTERED, REGISTERED[:-1] + ", delta=True\n")
    line = said_of(path)
    assert line.startswith(f"{path}:{line_of(text, 'return BsdfSample(')}: sample of BSDF")
    assert "returns no lobe" in line and "eta, lobe) is needed" in line


class Strange:
    def __str__(self):
        return "first line\nsecond at 0x7f0123456789"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (AssertionError(), "eval_pdf: AssertionError"),
        (KeyError("x"), "eval_pdf: 'x'"),
        (ValueError(Strange()), "eval_pdf: first line"),
        (TypeError("No implementation of function"), "eval_pdf: No implementation"),
    ],
)
def test_what_no_rule_knows_is_one_line_at_the_kernel(tmp_path, error, said):
    path = tmp_path / "mine.py"
    path.write_text(RIGHT)
    kernel = plugin_file.import_plugin_file(str(path)).eval_pdf
    line = one_line(str(explain(error, kernel)))
    assert line.startswith(f"{path}:{line_of(RIGHT, 'def eval_pdf')}: {said}")


def test_a_kernel_that_raises_while_it_renders_is_named(tmp_path):
    """A tuple that is indexed beyond its end is known when it happens."""
    error = IndexError("tuple index out of range")
    path = tmp_path / "mine.py"
    path.write_text(RIGHT)
    plugin_file.import_plugin_file(str(path))
    with pytest.raises(
        PluginError, match="BSDF 'lunar' failed: IndexError: tuple"
    ) as found:
        check.blame_users(error, [BSDFS["diffuse"], BSDFS["lunar"]])
    assert str(found.value).startswith(f"{path}:{line_of(RIGHT, 'def sample')}: ")
    check.blame_users(error, [BSDFS["diffuse"]])  # it stays as it is


# ------------------------------------------------------------------ commands and API


def test_the_api_raises_one_line_and_keeps_the_cause(tmp_path):
    path, text = written(tmp_path, COS_I, "    cos_i = max(wi.z, 0.0)\n")
    plugin_file.import_plugin_file(str(path))
    loaded = renderer.load_file(SCENE)
    with pytest.raises(renderer.SceneError) as caught:
        renderer.render(loaded, spp=1)
    assert one_line(str(caught.value)).startswith(f"{path}:{line_of(text, 'max(')}: ")
    assert "No implementation" in str(caught.value.__cause__)


@pytest.mark.parametrize("case", ["if", "pdf a number", "max", "field"])
def test_the_command_says_it_in_one_line(tmp_path, capsys, case):
    old, new, at, _ = IN_KERNELS[case]
    path, text = written(tmp_path, old, new)
    assert said_by_command(path, capsys).startswith(f"{path}:{line_of(text, at)}: ")


@pytest.mark.parametrize("case", ["if", "pdf a number"])
def test_the_harness_says_it_before_mitsuba_renders(tmp_path, capsys, case):
    """Not a bug of ours, nor a scene that one side refuses: the request is wrong."""
    old, new, at, said = IN_KERNELS[case]
    path, text = written(tmp_path, old, new)
    status = validate_command([str(SCENE), "--plugins", str(path), "--spp", "1"])
    captured = capsys.readouterr()
    shown = " ".join((captured.out + captured.err).split())
    assert status == VERDICTS["bad-request"].status
    assert f"{path}:{line_of(text, at)}: " in shown and said[0] in shown
    assert "correct proof.toml, -D or the file of --plugins" in shown
    assert "report it" not in shown and "Traceback" not in shown


# -------------------------------------------------------------- Mitsuba's own side

WITHOUT_TWIN = RIGHT[: RIGHT.index(TWIN)]
RAISING_TWIN = """\
def register_mitsuba():
    import mitsuba as mi

    class Twin(mi.BSDF):
        def __init__(self, props):
            super().__init__(props)
            self.m_flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]
            self.albedo = props.get_texture("albedo", 0.3)
            first()

        def eval(self, ctx, si, wo, active=True):
            return second()

    mi.register_bsdf("lunar", Twin)
"""
# in this order: Mitsuba's process keeps what is registered
TWINS = {
    "none": (RIGHT.replace(TWIN, "def mitsuba_twin():"), "",
             "no register_mitsuba(), so that Mitsuba does not know BSDF 'lunar'"),
    "raises at once": (f"{WITHOUT_TWIN}{TWIN}\n    first()\n", "    first()",
                       "register_mitsuba(): NameError: name 'first' is not defined"),
    "another name": (f"{WITHOUT_TWIN}{TWIN}\n    import mitsuba\n", TWIN,
                     "register_mitsuba() registers no BSDF 'lunar'"),
    "raises when it is made": (WITHOUT_TWIN + RAISING_TWIN, "    first()",
                               "in Mitsuba: NameError: name 'first' is not defined"),
    "no parameter": (WITHOUT_TWIN + RAISING_TWIN.replace("self.albedo = props", "props")
                     .replace(".get_texture(", ".__class__; (").replace("first()", ""),
                     TWIN, "does not read its parameter 'albedo'"),
    "raises when it is rendered": (
        WITHOUT_TWIN + RAISING_TWIN.replace("            first()\n", ""),
        "    return second()", "in Mitsuba: NameError: name 'second'"),
}  # fmt: skip


def test_a_plugin_is_told_what_is_wrong_with_its_twin(tmp_path):
    """Its own line, and not as a scene that Mitsuba refuses, nor as a bug of ours."""
    with MitsubaWorker(120.0) as worker:
        references = ReferenceCache(worker.render, tmp_path / "references")
        for name, (text, at, said) in TWINS.items():
            path = tmp_path / f"{name.replace(' ', '_')}.py"
            path.write_text(text)
            options = Options(plugins=path, threads=2, spp=1)
            with pytest.raises(PluginError) as caught:
                references.get(scene_request(SCENE, NO_PROOF, options), [])
            line = one_line(str(caught.value))
            place = f"{path}:{line_of(text, at)}" if at else str(path)
            assert line.startswith(f"{place}: ") and said in line
            assert "Mitsuba does not know" not in line or "adding-a-bsdf.md" in line
            stopped = stopped_by(caught.value, "Mitsuba, seed 1")
            assert stopped.verdict == "bad-request"
            assert not re.search("Mitsuba's format|report it", stopped.reasons[0])


@pytest.mark.parametrize(
    ("old", "new", "kernel"),
    [
        (EVALUATED, "    return f_cos * ((cos_i - 2.0) * 0.0 / 0.0), cos_i\n", "eval_pdf"),
        (SAMPLED, SAMPLED.replace("weight,", "weight * sqrt(wi.z - 1.0),"), "sample"),
    ],
    ids=["eval_pdf", "sample"],
)
def test_nan_is_refused(tmp_path, old, new, kernel):
    """It is not above 0, so that the light would be missing without a word."""
    path, _ = written(tmp_path, old, new)
    plugin_file.import_plugin_file(str(path))
    with pytest.raises(PluginError) as caught:
        renderer.render(renderer.load_file(SCENE), spp=1)
    line = one_line(str(caught.value))
    assert line.startswith(f"{path}:") and f"{kernel} of BSDF 'lunar' returns NaN" in line


# ------------------------------------------------------------------ what is right


def test_the_renderers_own_kinds_pass_the_check():
    """Otherwise the check would refuse what is right."""
    for name in ("diffuse", "conductor", "dielectric", "plastic", "thindielectric", "null"):
        kind = BSDFS[name]
        kernels = ((key, getattr(kind, key)) for key in ("sample", "eval_pdf", "albedo"))
        given = tuple((key, kernel) for key, kernel in kernels if kernel is not None)
        kind = dataclasses.replace(kind, users_kernels=given)
        assert set(hints_of(kind.parameters).values()) <= {Color, Float}
        check_kernels_of(kind, along_u(Plain()) if kind.oriented else Plain())


@pytest.mark.slow
def test_what_is_checked_is_what_is_rendered(tmp_path):
    """The types are the very ones of the render: no kernel is compiled a second time."""
    path = tmp_path / "mine.py"
    path.write_text(f"{RIGHT}\n# {uuid.uuid4()}: no kernel of it is in the cache\n")
    module = plugin_file.import_plugin_file(str(path))
    check_kernels_of_users([BSDFS["lunar"]], Plain())
    compiled = {name: list(getattr(module, name).overloads) for name in KERNELS}
    assert renderer.render(renderer.load_file(SCENE), spp=1).pixels.any()
    assert {name: list(getattr(module, name).overloads) for name in KERNELS} == compiled


def test_kinds_of_the_renderers_own_are_not_looked_at(monkeypatch):
    """Nor compiled by themselves: a scene without plugins starts as fast as before."""
    monkeypatch.setattr(check, "check_kernels_of", None)
    check_kernels_of_users([BSDFS["diffuse"], BSDFS["plastic"]], Plain())
