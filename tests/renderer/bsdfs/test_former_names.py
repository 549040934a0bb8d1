"""Files of users that import from where BSDFs and lanes lay before work for one version."""

import subprocess
import sys

FORMER = """
from renderer.kinds.bsdfs.kind import BsdfSample, Color, cosine_direction
from renderer.kinds.bsdfs.rough.microfacets import microfacets
from renderer.kernels.lanes.mathematics.exponentials import exp
from renderer.kernels.lanes.mathematics.error_function import erf
from renderer.kernels.lanes.mathematics.mathematics import sincos
from renderer.kernels.lanes import mathematics
from renderer.plugins.bsdfs import kind
assert BsdfSample is kind.BsdfSample and exp is mathematics.exp
"""


def test_former_names_are_the_same_objects_with_a_warning():
    words = [sys.executable, "-W", "always", "-c", FORMER]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("FutureWarning: renderer.kinds is now renderer.plugins") == 1
