"""Right solutions of the exercises as students may write them: other formulas than ours."""

from __future__ import annotations

CAMERA = '''
def camera_ray(x, y, width, height, origin, target, up, fov):
    """By a matrix, and with Python's own numbers."""
    def normal(v):
        return v / np.linalg.norm(v)
    z = normal(np.subtract(origin, target))
    r = normal(np.cross(up, z))
    u = np.cross(z, r)
    distance = 0.5 * width / math.tan(0.5 * fov * math.pi / 180)
    local = np.array([x - width / 2, height / 2 - y, -distance])
    return list(normal(np.column_stack([r, u, z]) @ local))
'''

SPHERE_GEOMETRIC = """
def intersect_sphere(origin, direction, center, radius, t_min, t_max):
    length = np.linalg.norm(direction)
    d = direction / length
    to_center = center - origin
    along = to_center @ d
    distance2 = to_center @ to_center - along ** 2
    if distance2 > radius ** 2:
        return None
    half = math.sqrt(radius ** 2 - distance2)
    for t in ((along - half) / length, (along + half) / length):
        if t_min < t < t_max:
            return t
"""

SPHERE_TEXTBOOK = """
def intersect_sphere(origin, direction, center, radius, t_min, t_max):
    a = np.dot(direction, direction)
    b = 2 * np.dot(direction, origin - center)
    c = np.dot(origin - center, origin - center) - radius**2
    roots = np.roots([a, b, c])
    real = [r.real for r in roots if abs(r.imag) < 1e-12 and t_min < r.real < t_max]
    return min(real) if real else None
"""

TRIANGLE_SOLVED = """
def intersect_triangle(origin, direction, p1, p2, p3, t_min, t_max):
    m = np.column_stack([p2 - p1, p3 - p1, -direction])
    try:
        u, v, t = np.linalg.solve(m, origin - p1)
    except np.linalg.LinAlgError:
        return None
    if u < 0 or v < 0 or u + v > 1 or not (t_min < t < t_max):
        return None
    return np.array([t, u, v])
"""

TRIANGLE_MOELLER = """
def intersect_triangle(origin, direction, p1, p2, p3, t_min, t_max):
    edge1 = p2 - p1
    edge2 = p3 - p1
    h = np.cross(direction, edge2)
    a = np.dot(edge1, h)
    if abs(a) < 1e-12:
        return None
    f = 1.0 / a
    s = origin - p1
    u = f * np.dot(s, h)
    if u < 0.0 or u > 1.0:
        return None
    q = np.cross(s, edge1)
    v = f * np.dot(direction, q)
    if v < 0.0 or u + v > 1.0:
        return None
    t = f * np.dot(edge2, q)
    if t <= t_min or t >= t_max:
        return None
    return t, u, v
"""

BARYCENTRIC = """
def intersect_barycentric(origin, direction, p1, p2, p3, t_min, t_max):
    n = np.cross(p2 - p1, p3 - p1)
    if n @ direction == 0:
        return None
    t = n @ (p1 - origin) / (n @ direction)
    if t <= t_min or t >= t_max:
        return None
    x = origin + t * direction
    k = int(np.argmax(abs(n)))  # drop the longest axis, and solve in two dimensions
    i, j = [(1, 2), (2, 0), (0, 1)][k]
    def area(a, b, c):
        return (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
    whole = area(p1, p2, p3)
    b1, b2 = area(x, p2, p3) / whole, area(p1, x, p3) / whole
    b3 = 1 - b1 - b2
    return (t, b1, b2, b3) if min(b1, b2, b3) >= 0 else None
"""

SOLUTIONS: dict[str, list[str]] = {
    "camera": [CAMERA],
    "sphere": [SPHERE_GEOMETRIC, SPHERE_TEXTBOOK],
    "triangle": [TRIANGLE_SOLVED, TRIANGLE_MOELLER],
    "barycentric": [BARYCENTRIC],
}

# what is written wrongly in a right solution, and the mistake that is to be named
FAULTS: list[tuple[str, str, str, str]] = [
    (
        TRIANGLE_MOELLER,
        "    if t <= t_min or t >= t_max:",
        "    if t >= t_max:",
        "no-t-min",
    ),
    (TRIANGLE_MOELLER, "t <= t_min", "t <= 0", "zero-t-min"),
    (TRIANGLE_MOELLER, "u + v > 1.0", "v > 1.0", "parallelogram"),
    (TRIANGLE_MOELLER, "abs(a) < 1e-12", "a < 1e-6", "culled"),
    (TRIANGLE_MOELLER, "1e-12", "1e-4", "large-epsilon"),
    (TRIANGLE_MOELLER, "return t, u, v", "return t, v, u", "u-v-exchanged"),
    (TRIANGLE_SOLVED, "[t, u, v]", "[t * np.linalg.norm(direction), u, v]", "distance"),
    (BARYCENTRIC, "(t, b1, b2, b3) if", "(t, b2, b3, b1) if", "corners-exchanged"),
    (
        SPHERE_GEOMETRIC,
        "for t in ((along - half) / length, (along + half) / length):",
        "for t in [(along - half) / length]:",
        "near-only",
    ),
    (
        SPHERE_GEOMETRIC,
        "    for t in ((along - half) / length, (along + half) / length):\n"
        "        if t_min < t < t_max:\n            return t",
        "    return (along - half) / length",
        "no-t-min+no-t-max",
    ),
    (SPHERE_TEXTBOOK, "b = 2 * ", "b = ", "factor-of-two"),
    (CAMERA, "height / 2 - y", "y - height / 2", "upside-down"),
    (CAMERA, "0.5 * fov * math.pi / 180", "fov * math.pi / 180", "whole-angle"),
    (CAMERA, "0.5 * width", "0.5 * height", "vertical-fov"),
    (CAMERA, "np.cross(up, z)", "np.cross(z, up)", "turned"),
]
