#!/usr/bin/env python3
"""Draws frames.svg: `python3 docs/images/frames.py`. Needs nothing but Python.

The scene is a true projection: rays through the camera's centre, image points where they pierce the
image plane. The aircraft are sketches, and nothing is to scale.
"""

import math
from pathlib import Path

WIDTH, HEIGHT = 1000, 560
RED, GREEN, BLUE = "#c62828", "#2e7d32", "#1565c0"
INK, MUTED, AMBER, PURPLE = "#263238", "#78909c", "#ef6c00", "#6a1b9a"

# The viewer stands behind the receiver on its right, above it: receiver axes -> drawing, pixels.
AZIMUTH, ELEVATION, SCALE = math.radians(57), math.radians(24), 55.0
ORIGIN = (142, 440)
CAMERA = (1.75, 0.0, 0.0)  # of the camera's centre in the receiver, m
FOCAL = 2.7  # from the centre to the drawn image plane, m
HALF_U, HALF_V = 1.73, 1.40  # of the image plane, m: 508 to 412
TANKER = (12.2, -0.6, 1.75)  # of the tanker's origin in the receiver, m


def screen(p):
    """Point in receiver axes -> drawing."""
    x, y, z = p
    right = x * math.sin(AZIMUTH) - y * math.cos(AZIMUTH)
    ahead = x * math.cos(AZIMUTH) + y * math.sin(AZIMUTH)
    up = z * math.cos(ELEVATION) + ahead * math.sin(ELEVATION)
    return ORIGIN[0] + SCALE * right, ORIGIN[1] - SCALE * up


def plus(a, b, factor=1.0):
    return tuple(p + factor * q for p, q in zip(a, b))


def in_tanker(p):
    return plus(TANKER, p)


def image(p):
    """Where the ray to a point pierces the image plane, in receiver axes."""
    d = plus(p, CAMERA, -1.0)
    return plus(CAMERA, d, FOCAL / d[0])


parts = []


def points(ps):
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in map(screen, ps))


def polygon(ps, fill, stroke=INK, width=1.2, opacity=1.0):
    parts.append(
        f'<polygon points="{points(ps)}" fill="{fill}" fill-opacity="{opacity}" stroke="{stroke}" '
        f'stroke-width="{width}" stroke-linejoin="round"/>'
    )


def line(a, b, colour, width=1.5, dash="", marker=""):
    (x1, y1), (x2, y2) = screen(a), screen(b)
    more = f' stroke-dasharray="{dash}"' if dash else ""
    more += f' marker-end="url(#{marker})"' if marker else ""
    parts.append(
        f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" '
        f'stroke-width="{width}"{more}/>'
    )


def dot(p, colour, radius, stroke="#ffffff"):
    x, y = screen(p)
    parts.append(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}" stroke="{stroke}" stroke-width="1.2"/>'
    )


def text(x, y, words, colour=INK, size=15, anchor="start", weight="normal"):
    font = f'font-size="{size}" text-anchor="{anchor}" font-weight="{weight}"'
    # The white outline comes first, as an element of its own: not every viewer knows paint-order.
    for paint in ['fill="none" stroke="#ffffff" stroke-width="4" stroke-linejoin="round"', f'fill="{colour}"']:
        parts.append(f'<text x="{x:.1f}" y="{y:.1f}" {font} {paint}>{words}</text>')


def label(p, words, dx, dy, colour=INK, **more):
    x, y = screen(p)
    text(x + dx, y + dy, words, colour, **more)


def axis(origin, direction, length, colour, words, dx, dy, anchor="start"):
    tip = plus(origin, direction, length)
    line(origin, tip, colour, 2.6, marker={RED: "red", GREEN: "green", BLUE: "blue"}[colour])
    label(tip, words, dx, dy, colour, anchor=anchor, weight="bold", size=14)


def aircraft(place, wing, tail, fin, nose, end, body, fill):
    """A sketch in the axes of its body: half spans, fin height, ends and half width of the fuselage."""
    polygon([place(p) for p in [(0.7, 0, 0), (-0.5, wing, 0), (-1.1, wing, 0), (-0.7, 0, 0),
                                (-1.1, -wing, 0), (-0.5, -wing, 0)]], fill)
    polygon([place(p) for p in [(end + 0.8, 0, 0), (end + 0.1, tail, 0), (end - 0.3, tail, 0), (end, 0, 0),
                                (end - 0.3, -tail, 0), (end + 0.1, -tail, 0)]], fill)
    polygon([place(p) for p in [(nose, 0, 0), (nose - 0.8, body, 0), (end + 0.6, body, 0), (end - 0.1, 0, 0.08),
                                (end + 0.6, -body, 0), (nose - 0.8, -body, 0)]], fill)
    polygon([place(p) for p in [(end + 0.9, 0, 0.1), (end, 0, fin), (end - 0.4, 0, fin), (end, 0, 0.05)]], fill)


# The tanker and its beacons
aircraft(in_tanker, 3.9, 1.75, 1.6, 3.3, -3.2, 0.36, "#eceff1")
beacons = [in_tanker(p) for p in [(-0.8, 3.9, 0), (-0.8, -3.9, 0), (-3.3, 1.75, 0), (-3.3, -1.75, 0), (-3.4, 0, 1.6)]]
for beacon in beacons:
    line(image(beacon), beacon, AMBER, 1.1, "5 4")

# The receiver, its camera and the image plane
aircraft(lambda p: p, 1.75, 0.85, 0.75, 1.55, -1.7, 0.2, "#eceff1")
plane = plus(CAMERA, (FOCAL, 0, 0))
top_left = plus(plane, (0, HALF_U, HALF_V))
corners = [top_left, plus(plane, (0, -HALF_U, HALF_V)), plus(plane, (0, -HALF_U, -HALF_V)), plus(plane, (0, HALF_U, -HALF_V))]
polygon(corners, "#fff8e1", MUTED, 1.2, 0.82)
for beacon in beacons:
    line(CAMERA, image(beacon), AMBER, 1.1)
    dot(image(beacon), AMBER, 3.6)
axis(top_left, (0, -1, 0), 1.25, RED, "u", 4, -8)
axis(top_left, (0, 0, -1), 1.1, GREEN, "v", -8, 6, "end")
dot(top_left, INK, 3)
label(top_left, "pixel (0, 0)", -8, -8, INK, size=13, anchor="end")

# The transform
line(CAMERA, in_tanker((-0.12, 0, -0.03)), PURPLE, 2.2, "9 4", "purple")

# Axes
axis(in_tanker((0, 0, 0)), (1, 0, 0), 2.2, RED, "x forward", 8, 4)
axis(in_tanker((0, 0, 0)), (0, 1, 0), 1.9, GREEN, "y left", -8, -6, "end")
axis(in_tanker((0, 0, 0)), (0, 0, 1), 1.75, BLUE, "z up", 8, 0)
dot(in_tanker((0, 0, 0)), INK, 4)
for beacon in beacons:
    dot(beacon, AMBER, 6)
axis((0, 0, 0), (1, 0, 0), 1.0, RED, "", 0, 0)
axis((0, 0, 0), (0, 1, 0), 1.3, GREEN, "y left", -6, -5, "end")
axis((0, 0, 0), (0, 0, 1), 1.5, BLUE, "z up", -6, -6, "end")
dot((0, 0, 0), INK, 4)
label((1.0, 0, 0), "x forward", -42, -9, RED, size=14, weight="bold")
axis(CAMERA, (0, -1, 0), 1.45, RED, "x right", 8, 10)
axis(CAMERA, (0, 0, -1), 1.35, GREEN, "y down", 8, 10)
axis(CAMERA, (1, 0, 0), 1.5, BLUE, "", 0, 0)
label(plus(CAMERA, (1.5, 0, 0)), "z ahead", 10, 16, BLUE, size=14, weight="bold")
dot(CAMERA, INK, 4.5)

# Words
text(24, 34, "Frames of tanker_pose", size=19, weight="bold")
text(24, 56, "schematic, not to scale", MUTED, size=13)
label(in_tanker((3.3, 0, 0)), "tanker", 14, -14, size=17, weight="bold")
label((0, 0, 0), "receiver", -82, 74, size=17, weight="bold", anchor="middle")
label(CAMERA, "camera (optical frame)", -46, 96, size=17, weight="bold")
label(corners[2], "image plane", 8, 2, MUTED, size=14)
label(beacons[1], "beacon: id, position in the tanker frame", -104, 42, AMBER, size=14)
text(596, 452, "camera_from_tanker", PURPLE, size=17, weight="bold")
text(596, 476, "p_camera = R p_tanker + t", PURPLE, size=15)
text(596, 499, "t: position of the tanker's origin in the camera frame", PURPLE, size=13)
text(596, 518, "published on `pose` with its covariance", PURPLE, size=13)


def head(name, colour):
    return (
        f'<marker id="{name}" viewBox="0 0 10 10" refX="7" refY="5" markerWidth="11" markerHeight="11" '
        f'markerUnits="userSpaceOnUse" orient="auto"><path d="M0,1 L9,5 L0,9 z" fill="{colour}"/></marker>'
    )


heads = "".join(head(*pair) for pair in [("red", RED), ("green", GREEN), ("blue", BLUE), ("purple", PURPLE)])
svg = f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="DejaVu Sans, Verdana, sans-serif">
<title>Tanker, receiver and camera frames, and the transform camera_from_tanker</title>
<defs>{heads}</defs>
<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>
""" + "\n".join(parts) + "\n</svg>\n"
Path(__file__).with_suffix(".svg").write_text(svg)
