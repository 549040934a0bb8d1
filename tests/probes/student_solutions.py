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

NORMALS_TANGENTS = '''
def shading_normal(n1, n2, n3, u, v, world_from_object):
    """By two tangents, which are carried into the world."""
    n = n1 + u * (n2 - n1) + v * (n3 - n1)
    helper = np.eye(3)[np.argmin(abs(n))]
    s = np.cross(n, helper)
    t = np.cross(n, s)
    m = np.cross(world_from_object @ s, world_from_object @ t)
    if np.linalg.det(world_from_object) < 0:
        m = -m
    return m / np.linalg.norm(m)
'''

NORMALS_SOLVED = """
def shading_normal(n1, n2, n3, u, v, world_from_object):
    w = 1 - u - v
    n = np.linalg.solve(world_from_object.T, w * n1 + u * n2 + v * n3)
    return n / math.sqrt(sum(n ** 2))
"""

LIGHT_UNIT = """
def direct_light(x, normal, albedo, lights, is_blocked):
    result = 0
    for p, intensity in lights:
        r = np.linalg.norm(p - x)
        wi = (p - x) / r
        cos = np.dot(wi, normal)
        if cos <= 0:
            continue
        if is_blocked(x + 1e-4 * normal, wi, 0.0, r * (1 - 1e-4)):
            continue
        result += albedo / np.pi * intensity / r ** 2 * cos
    return result
"""

LIGHT_WHOLE = """
def direct_light(x, normal, albedo, lights, is_blocked):
    def one(position, intensity):
        to_light = position - x
        if is_blocked(x, to_light, 1e-4, 1):
            return 0.0
        r2 = sum(to_light * to_light)
        return intensity * max(0.0, normal @ to_light) / r2 ** 1.5
    return albedo * sum(one(*light) for light in lights) / math.pi
"""

BOX_NUMPY = """
def intersect_box(origin, direction, lower, upper, t_min, t_max):
    t1 = (lower - origin) / direction
    t2 = (upper - origin) / direction
    enter = max(t_min, np.minimum(t1, t2).max())
    leave = min(t_max, np.maximum(t1, t2).min())
    return (enter, leave) if enter <= leave else None
"""

BOX_LOOP = """
def intersect_box(origin, direction, lower, upper, t_min, t_max):
    for o, d, low, high in zip(origin.tolist(), direction.tolist(), lower, upper):
        if d == 0:
            if o < low or o > high:
                return None
            continue
        near, far = (low - o) / d, (high - o) / d
        if d < 0:
            near, far = far, near
        if near > t_min:
            t_min = near
        if far < t_max:
            t_max = far
        if t_min > t_max:
            return None
    return t_min, t_max
"""

GRID_SORTED = '''
def walk_grid(origin, direction, lower, cell_size, resolution):
    """Sort all planes that are met, and look into the middle between two."""
    t = [0.0]
    for axis in range(3):
        if direction[axis] != 0:
            planes = lower[axis] + np.arange(resolution[axis] + 1) * cell_size[axis]
            t += list((planes - origin[axis]) / direction[axis])
    t = sorted(v for v in t if v >= 0)
    cells = []
    for a, b in zip(t, t[1:]):
        x = origin + 0.5 * (a + b) * direction
        cell = tuple(np.floor((x - lower) / cell_size).astype(int))
        if all(0 <= c < n for c, n in zip(cell, resolution)):
            cells.append(cell)
    return cells
'''

GRID_DDA = """
def walk_grid(origin, direction, lower, cell_size, resolution):
    upper = lower + np.array(resolution) * cell_size
    enter, leave = 0.0, math.inf
    for k in range(3):
        if direction[k] == 0:
            if not lower[k] <= origin[k] <= upper[k]:
                return []
        else:
            a, b = sorted([(lower[k] - origin[k]) / direction[k],
                           (upper[k] - origin[k]) / direction[k]])
            enter, leave = max(enter, a), min(leave, b)
    if enter > leave:
        return []
    x = origin + enter * direction
    cell = [min(max(int((x[k] - lower[k]) / cell_size[k]), 0), resolution[k] - 1)
            for k in range(3)]
    cells = []
    while True:
        cells.append(tuple(cell))
        nearest, axis = math.inf, 0
        for k in range(3):
            if direction[k] > 0:
                t = (lower[k] + (cell[k] + 1) * cell_size[k] - origin[k]) / direction[k]
            elif direction[k] < 0:
                t = (lower[k] + cell[k] * cell_size[k] - origin[k]) / direction[k]
            else:
                continue
            if t < nearest:
                nearest, axis = t, k
        cell[axis] += 1 if direction[axis] > 0 else -1
        if not 0 <= cell[axis] < resolution[axis]:
            return cells
"""

KD_RECURSIVE = """
def closest_hit(tree, origin, direction, t_max, intersect):
    def visit(node, enter, leave):
        if enter > leave:
            return None
        if isinstance(node, list):
            hits = [(t, k) for k in node for t in [intersect(k)] if t is not None]
            return min((h for h in hits if h[0] < t_max), default=None)
        axis, position, below, above = node
        if direction[axis] == 0:
            return visit(below if origin[axis] <= position else above, enter, leave)
        t = (position - origin[axis]) / direction[axis]
        first, second = (below, above) if direction[axis] > 0 else (above, below)
        if t >= leave:
            return visit(first, enter, leave)
        if t <= enter:
            return visit(second, enter, leave)
        hit = visit(first, enter, t)
        if hit is not None and hit[0] <= t:
            return hit
        other = visit(second, t, leave)
        return min((h for h in (hit, other) if h is not None), default=None)
    return visit(tree, 0.0, t_max)
"""

BVH_SWEEP = """
def split_boxes(lower, upper):
    n = len(lower)
    def half_area(a, b):
        d = b - a
        return d[0] * d[1] + d[1] * d[2] + d[2] * d[0]
    total = half_area(np.min(lower, axis=0), np.max(upper, axis=0))
    best = (float(n), None)
    for axis in range(3):
        order = sorted(range(n), key=lambda i: lower[i][axis] + upper[i][axis])
        low, high = np.array([np.inf] * 3), np.array([-np.inf] * 3)
        from_right = [0.0] * n
        for k in range(n - 1, 0, -1):
            low, high = np.minimum(low, lower[order[k]]), np.maximum(high, upper[order[k]])
            from_right[k] = half_area(low, high)
        low, high = np.array([np.inf] * 3), np.array([-np.inf] * 3)
        for k in range(1, n):
            low = np.minimum(low, lower[order[k - 1]])
            high = np.maximum(high, upper[order[k - 1]])
            cost = 1 + (half_area(low, high) * k + from_right[k] * (n - k)) / total
            if cost < best[0]:
                best = (cost, order[k:])
    return best[1]
"""

REFRACTION_ANGLES = """
def reflect(d, n):
    return (np.eye(3) - 2 * np.outer(n, n)) @ d

def refract(d, n, eta):
    across = d + np.dot(-d, n) * n
    sin_i = np.linalg.norm(across)
    sin_t = eta * sin_i
    if sin_t > 1:
        return None
    if sin_i == 0:
        return d
    angle = math.asin(sin_t)
    return math.sin(angle) * across / sin_i - math.cos(angle) * n
"""

FRESNEL_ANGLES = """
def fresnel(cos_i, eta):
    n_i, n_t = eta, 1.0
    sin_t = n_i / n_t * math.sqrt(1 - cos_i ** 2)
    if sin_t >= 1:
        return 1.0
    cos_t = math.sqrt(1 - sin_t ** 2)
    r_s = (n_i * cos_i - n_t * cos_t) / (n_i * cos_i + n_t * cos_t)
    r_p = (n_i * cos_t - n_t * cos_i) / (n_i * cos_t + n_t * cos_i)
    return 0.5 * (r_s ** 2 + r_p ** 2)
"""

FRESNEL_COMPLEX = """
def fresnel(cos_i, eta):
    root = np.sqrt(complex(1 / eta ** 2 - 1 + cos_i ** 2))
    s = abs((cos_i - root) / (cos_i + root)) ** 2
    p = abs((cos_i / eta ** 2 - root) / (cos_i / eta ** 2 + root)) ** 2
    return (s + p) / 2
"""

COSINE_CONCENTRIC = """
def sample_cosine(u1, u2):
    a, b = 2 * u1 - 1, 2 * u2 - 1
    if a == 0 and b == 0:
        return np.array([0, 0, 1.0]), 1 / math.pi
    if abs(a) > abs(b):
        r, phi = a, math.pi / 4 * b / a
    else:
        r, phi = b, math.pi / 2 - math.pi / 4 * a / b
    z = math.sqrt(max(0, 1 - r * r))
    return [r * math.cos(phi), r * math.sin(phi), z], z / math.pi
"""

COSINE_INVERSE_CDF = """
def sample_cosine(u1, u2):
    theta = 0.5 * math.acos(1 - 2 * u2)
    phi = 2 * math.pi * (1 - u1)
    w = np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi),
                  math.cos(theta)])
    return w, w[2] / np.pi
"""

COSINE_SUM = '''
def sample_cosine(u1, u2):
    """The normal and a point of the whole sphere: their sum has this density."""
    z = 1 - 2 * u1
    r = math.sqrt(max(0.0, 1 - z * z))
    w = np.array([r * math.cos(2 * math.pi * u2), r * math.sin(2 * math.pi * u2), 1 + z])
    w /= np.linalg.norm(w)
    return w, w[2] / math.pi
'''

MIS_BALANCE = """
def mis_estimate(f, pdf_a, pdf_b, samples_a, samples_b):
    n, m = len(samples_a), len(samples_b)
    return sum(f(x) / (n * pdf_a(x) + m * pdf_b(x)) for x in list(samples_a) + samples_b)
"""

MIS_POWER = """
def mis_estimate(f, pdf_a, pdf_b, samples_a, samples_b):
    def part(p, q, xs, n_q):
        if not xs:
            return 0.0
        values = []
        for x in xs:
            r = n_q * q(x) / (len(xs) * p(x))
            values.append(f(x) / p(x) / (1 + r ** 2))
        return np.mean(values)
    return (part(pdf_a, pdf_b, samples_a, len(samples_b))
            + part(pdf_b, pdf_a, samples_b, len(samples_a)))
"""

PATH_UNIFORM = """
def path_radiance(origin, direction, closest_hit, random, bounces):
    hit = closest_hit(origin, direction)
    if hit is None:
        return 0.0
    if bounces == 0:
        return hit.emission
    while True:  # equally likely directions, by rejection
        w = np.array([2 * random() - 1 for _ in range(3)])
        length = np.linalg.norm(w)
        if 0 < length <= 1:
            break
    w /= length
    cosine = w @ hit.normal
    if cosine < 0:
        w, cosine = -w, -cosine
    f, pdf = hit.albedo / math.pi, 1 / (2 * math.pi)
    light = path_radiance(hit.x, w, closest_hit, random, bounces - 1)
    return hit.emission + f * cosine / pdf * light
"""

PATH_COSINE = """
def path_radiance(origin, direction, closest_hit, random, bounces):
    radiance, beta = 0.0, 1.0
    while bounces >= 0:
        hit = closest_hit(origin, direction)
        if hit is None:
            return radiance
        radiance += beta * hit.emission
        beta *= hit.albedo
        if beta == 0:
            return radiance
        z = 1 - 2 * random()
        phi = 2 * math.pi * random()
        r = math.sqrt(1 - z * z)
        direction = hit.normal + np.array([r * math.cos(phi), r * math.sin(phi), z])
        direction /= np.linalg.norm(direction)
        origin = hit.x
        bounces -= 1
    return radiance
"""

BSDF_DIFFUSE = """
def eval_bsdf(wi, wo):
    return 0.7 / math.pi if wi[2] > 0 else 0.0

def pdf_bsdf(wi, wo):
    return max(0.0, wi[2]) / math.pi

def sample_bsdf(wo, u1, u2):
    r, phi = math.sqrt(u1), 2 * math.pi * u2
    return np.array([r * math.cos(phi), r * math.sin(phi), math.sqrt(1 - u1)])
"""

BSDF_BLINN = """
N = 20

def eval_bsdf(wi, wo):
    if wi[2] <= 0:
        return 0.0
    h = wi + wo
    h = h / np.linalg.norm(h)
    shine = 0.3 * (N + 8) / (8 * math.pi) * h[2] ** N
    return 0.3 / math.pi + shine

def pdf_bsdf(wi, wo):
    diffuse = max(0.0, wi[2]) / math.pi
    h = wi + wo
    length = np.linalg.norm(h)
    if length == 0:
        return 0.4 * diffuse
    h = h / length * (1 if h[2] >= 0 else -1)
    density = (N + 1) / (2 * math.pi) * h[2] ** N / (4 * abs(h @ wo))
    return 0.4 * diffuse + 0.6 * density

def sample_bsdf(wo, u1, u2):
    phi = 2 * math.pi * u2
    if u1 < 0.4:
        u1 = u1 / 0.4
        r = math.sqrt(u1)
        return np.array([r * math.cos(phi), r * math.sin(phi), math.sqrt(1 - u1)])
    u1 = (u1 - 0.4) / 0.6
    z = (1 - u1) ** (1 / (N + 1))
    r = math.sqrt(1 - z * z)
    h = np.array([r * math.cos(phi), r * math.sin(phi), z])
    return 2 * (wo @ h) * h - wo
"""

SOLUTIONS: dict[str, list[str]] = {
    "camera": [CAMERA],
    "sphere": [SPHERE_GEOMETRIC, SPHERE_TEXTBOOK],
    "triangle": [TRIANGLE_SOLVED, TRIANGLE_MOELLER],
    "barycentric": [BARYCENTRIC],
    "normals": [NORMALS_TANGENTS, NORMALS_SOLVED],
    "point_light": [LIGHT_UNIT, LIGHT_WHOLE],
    "box": [BOX_NUMPY, BOX_LOOP],
    "grid": [GRID_SORTED, GRID_DDA],
    "kd_tree": [KD_RECURSIVE],
    "bvh": [BVH_SWEEP],
    "refraction": [REFRACTION_ANGLES],
    "fresnel": [FRESNEL_ANGLES, FRESNEL_COMPLEX],
    "cosine": [COSINE_CONCENTRIC, COSINE_INVERSE_CDF, COSINE_SUM],
    "mis": [MIS_BALANCE, MIS_POWER],
    "path": [PATH_UNIFORM, PATH_COSINE],
    "bsdf": [BSDF_DIFFUSE, BSDF_BLINN],
}
