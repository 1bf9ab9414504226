"""Marker map files for tests that need another tanker than the paper's."""

from pathlib import Path

Markers = dict[int, tuple[float, float, float]]


def write_marker_map(
    path: Path, markers: Markers, name: str = "test", sigma_m: float | None = None
) -> Path:
    """Writes the YAML that the parameter `marker_map` names; `sigma_m`: of the survey, exact without it."""
    lines = [f"name: {name}"]
    lines += [] if sigma_m is None else [f"sigma: {sigma_m}"]
    lines += ["markers:"]
    lines += [
        f"  - {{id: {marker}, x: {x}, y: {y}, z: {z}}}" for marker, (x, y, z) in markers.items()
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
