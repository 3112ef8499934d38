"""Light on surfaces and tubes, in linear light, and the pictures that have them."""

from __future__ import annotations

from math import sqrt

from particlesim.compiler import kernel
from particlesim.model.vectors import dot
from particlesim.render.kernels.multisample import SUBSAMPLES
from particlesim.render.kernels.project import BAND
from particlesim.render.kernels.records import (
    Array,
    Float32s,
    Light,
    Paths,
    Samples,
    ShadowMap,
    SkyMap,
    Solids,
    Triple,
    View,
)
from particlesim.render.kernels.shade import (
    RGB,
    ball_of,
    light_share,
    mix,
    open_sky,
    row_of,
    shade_sphere,
    shaded,
    to_world,
)

CLOTH_GLOW = 0.30
"""Share of the light on its other side that shines through a cloth."""


def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _unit(a: Triple) -> Triple:
    s = 1.0 / sqrt(max(a[0] * a[0] + a[1] * a[1] + a[2] * a[2], 1e-60))
    return a[0] * s, a[1] * s, a[2] * s


def _lit_point(
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    p: Triple,
    n: Triple,
    to_eye: Triple,
    albedo: Triple,
    glow: float,
    gloss: float,
    lift: float,
) -> RGB:
    """Light that a point p with the unit normal n, on the side of the camera, sends to the eye.

    `glow`: share of the light on the other side that comes through. `gloss`: strength of the highlight (Blinn, exponent
    24). `lift`: distance [scene units] at which shadows are looked up, so that a surface does not shade itself.
    """
    d = light.direction
    facing = dot(n, d)
    side = 1.0 if facing > 0.0 else -1.0
    key = facing if facing > 0.0 else -glow * facing
    shine = 0.0
    if key > 0.0:
        to = 2.0 / shadow.scale
        share = light_share(
            shadow,
            p[0] + side * lift * n[0] + to * d[0],
            p[1] + side * lift * n[1] + to * d[1],
            p[2] + side * lift * n[2] + to * d[2],
        )
        key *= share
        if facing > 0.0:
            half = _unit((d[0] + to_eye[0], d[1] + to_eye[1], d[2] + to_eye[2]))
            h = max(dot(n, half), 0.0)
            h = h * h
            h = h * h * h * h
            shine = gloss * h * h * h * share
    rim = 1.0 - min(max(dot(n, to_eye), 0.0), 1.0)
    up = 0.5 + 0.5 * dot(n, light.up)
    ambient = open_sky(sky, p[0] + lift * n[0], p[1] + lift * n[1], p[2] + lift * n[2])
    shine += 0.10 * rim * rim * rim * up * ambient
    return shaded(light, albedo, key, ambient, up, shine)


def _shade_triangle(
    view: View,
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    sphere: Float32s,
    color: Array,
    palette: Float32s,
    solids: Solids,
    t: int,
    vx: float,
    vy: float,
) -> RGB:
    """Colour of triangle t on the ray (vx, vy, 1), or at its point nearest to the ray where that misses it."""
    a, b, c = solids.corner[t, 0], solids.corner[t, 1], solids.corner[t, 2]
    p, q, r = row_of(sphere, a), row_of(sphere, b), row_of(sphere, c)
    # Barycentric coordinates of the ray's hit: the volumes that the ray spans with the edges.
    d = (vx, vy, 1.0)
    e0, e1, e2 = dot(d, _cross(q, r)), dot(d, _cross(r, p)), dot(d, _cross(p, q))
    total = e0 + e1 + e2
    inv = 1.0 / total if total != 0.0 else 0.0
    e0, e1, e2 = max(e0 * inv, 0.0), max(e1 * inv, 0.0), max(e2 * inv, 0.0)
    inv = 1.0 / max(e0 + e1 + e2, 1e-12)
    e0, e1, e2 = e0 * inv, e1 * inv, e2 * inv
    x, y = e0 * p[0] + e1 * q[0] + e2 * r[0], e0 * p[1] + e1 * q[1] + e2 * r[1]
    z = e0 * p[2] + e1 * q[2] + e2 * r[2]
    flat = _cross((q[0] - p[0], q[1] - p[1], q[2] - p[2]), (r[0] - p[0], r[1] - p[1], r[2] - p[2]))
    # Right, up and forward are a left-handed frame: the cross product points to the triangle's back.
    front = 1.0 if flat[0] * x + flat[1] * y + flat[2] * z > 0.0 else -1.0
    n0 = row_of(solids.normal, solids.shade[t, 0])
    n1 = row_of(solids.normal, solids.shade[t, 1])
    n2 = row_of(solids.normal, solids.shade[t, 2])
    n = _unit(
        (
            front * (e0 * n0[0] + e1 * n1[0] + e2 * n2[0]),
            front * (e0 * n0[1] + e1 * n1[1] + e2 * n2[1]),
            front * (e0 * n0[2] + e1 * n1[2] + e2 * n2[2]),
        )
    )
    w, eye = to_world(view, x, y, z), view.eye
    albedo = row_of(palette, int(e0 * color[a] + e1 * color[b] + e2 * color[c] + 0.5))
    closed = solids.closed[t]
    return _lit_point(
        light,
        shadow,
        sky,
        (eye[0] + w[0], eye[1] + w[1], eye[2] + w[2]),
        n,
        _unit((-w[0], -w[1], -w[2])),
        albedo,
        0.0 if closed else CLOTH_GLOW,
        0.22 if closed else 0.06,
        3.0 / shadow.scale,
    )


def _shade_tube(
    view: View,
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    sphere: Float32s,
    palette: Float32s,
    solids: Solids,
    least: float,
    t: int,
    vx: float,
    vy: float,
) -> RGB:
    """Colour of tube t on the ray (vx, vy, 1).

    With the axis along a, the ray along d and g = d − (d·a) a, the normal where the ray passes the axis at the distance
    s r lies in the plane of q ⟂ a, d and of −g: n = s q − √(1 − s²) g/|g|.
    """
    p, end = row_of(sphere, solids.end[t, 0]), row_of(sphere, solids.end[t, 1])
    arm = (end[0] - p[0], end[1] - p[1], end[2] - p[2])
    length = sqrt(max(dot(arm, arm), 1e-30))
    a, d = (arm[0] / length, arm[1] / length, arm[2] / length), _unit((vx, vy, 1.0))
    da = dot(d, a)
    g = (d[0] - da * a[0], d[1] - da * a[1], d[2] - da * a[2])
    g2 = max(dot(g, g), 1e-9)
    # The point of the ray nearest to the axis is at u d with u g² = p·g; there the axis is at `along`.
    u = dot(p, g) / g2
    along = min(max((u * da - dot(p, a)) / length, 0.0), 1.0)
    x, y, z = p[0] + along * arm[0], p[1] + along * arm[1], p[2] + along * arm[2]
    side = _unit(_cross(a, d))
    radius = max(solids.radius[t], least * z / view.focal)
    across = -dot((p[0], p[1], p[2]), side) / radius
    # A line about as thin as a sample is lit like its middle: single samples of its round side would flicker.
    across *= min(radius * view.focal / (1.5 * z), 1.0)
    across = min(max(across, -1.0), 1.0)
    s, h = 1.0 / sqrt(g2), sqrt(1.0 - across * across)
    n = _unit(
        (across * side[0] - h * s * g[0], across * side[1] - h * s * g[1], across * side[2] - h * s * g[2])
    )
    n, w, eye = to_world(view, n[0], n[1], n[2]), to_world(view, x, y, z), view.eye
    share = float(solids.end_color[t, 0])
    albedo = row_of(palette, int(share + along * (solids.end_color[t, 1] - share) + 0.5))
    return _lit_point(
        light,
        shadow,
        sky,
        (eye[0] + w[0] + radius * n[0], eye[1] + w[1] + radius * n[1], eye[2] + w[2] + radius * n[2]),
        n,
        _unit((-w[0], -w[1], -w[2])),
        albedo,
        0.0,
        0.16,
        1.5 / shadow.scale + 0.3 * radius,
    )


def _together(samples: Samples, y: int, x: int, s: int, q: int, first: int, last: int, gap: float) -> bool:
    """Whether two points of a sample see the same thing: one number, or triangles first … last − 1 at nearly one depth."""
    i, j = samples.id[y, x, s], samples.id[y, x, q]
    if i == j:
        return True
    if not (first <= i < last and first <= j < last):
        return False
    v, w = samples.inverse[y, x, s], samples.inverse[y, x, q]
    return abs(v - w) < gap * v


@kernel
def shade_samples(
    row0: int,
    view: View,
    light: Light,
    shadow: ShadowMap,
    sky: SkyMap,
    sphere: Float32s,
    color: Array,
    palette: Float32s,
    solids: Solids,
    least: float,
    samples: Samples,
    paths: Paths,
    image: Float32s,
) -> None:
    """Blend things over the background in the band's samples, `image` [rows, width, 3]: each thing that a sample sees is
    lit once, and weighed by the number of points in which it is seen."""
    inv = 1.0 / view.focal
    triangles, tubes = len(sphere), len(sphere) + len(solids.corner)
    trails = len(paths.alpha) > 0
    every = (1 << SUBSAMPLES) - 1
    for y in range(min(BAND, view.height - row0)):
        vy = (0.5 * view.height - (row0 + y + 0.5)) * inv
        for x in range(view.width):
            vx = (x + 0.5 - 0.5 * view.width) * inv
            trail = float(paths.alpha[y, x]) if trails else 0.0
            r, g, b = 0.0, 0.0, 0.0
            done = 0
            for s in range(SUBSAMPLES):
                i = samples.id[y, x, s]
                if done >> s & 1 or i < 0:
                    continue
                weight = 0.0
                for q in range(s, SUBSAMPLES):
                    if not done >> q & 1 and _together(samples, y, x, s, q, triangles, tubes, 4.0 * inv):
                        done |= 1 << q
                        weight += 1.0 / SUBSAMPLES
                if i < triangles:
                    cr, cg, cb, _ = shade_sphere(
                        view, light, shadow, sky, ball_of(sphere, i), row_of(palette, color[i]), vx, vy
                    )
                elif i < tubes:
                    cr, cg, cb = _shade_triangle(
                        view, light, shadow, sky, sphere, color, palette, solids, i - triangles, vx, vy
                    )
                else:
                    cr, cg, cb = _shade_tube(
                        view, light, shadow, sky, sphere, palette, solids, least, i - tubes, vx, vy
                    )
                if trail > 0.0 and paths.depth[y, x] * samples.inverse[y, x, s] < 1.0:
                    cr, cg, cb = mix(cr, cg, cb, row_of(palette, paths.color[y, x]), trail)
                r, g, b = r + weight * cr, g + weight * cg, b + weight * cb
            if done != every:
                empty = 0.0
                for s in range(SUBSAMPLES):
                    empty += 0.0 if done >> s & 1 else 1.0 / SUBSAMPLES
                cr, cg, cb = image[y, x, 0], image[y, x, 1], image[y, x, 2]
                if trail > 0.0:
                    cr, cg, cb = mix(cr, cg, cb, row_of(palette, paths.color[y, x]), trail)
                r, g, b = r + empty * cr, g + empty * cg, b + empty * cb
            image[y, x, 0], image[y, x, 1], image[y, x, 2] = r, g, b
