"""The surface in 3-D with the path and the C-scan on it, as plotly's JSON (no library needed to write it)."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.report.content import ReportContent
from eddyscan.report.figures_signal import CRACK_CHANNELS
from eddyscan.report.mesh_thinning import thinned
from eddyscan.report.words import label

MOST_VERTICES = 30_000
MOST_PATH_POINTS = 20_000
MOST_ROWS = 40  # more would hide the surface: the reader shows them by a click on the legend
MARK_ABOVE_MM = 1.5
GREY, GREY_SHARE = "#8a949d", 0.02


def typed(values: Array | IntArray) -> dict[str, str]:
    """Return an array as plotly's typed-array JSON: float32, or the smallest unsigned integer."""
    data = np.asarray(values)
    whole = "u2" if data.max(initial=0) < 2**16 else "u4"
    kind = whole if np.issubdtype(data.dtype, np.integer) else "f4"
    return {"dtype": kind, "bdata": base64.b64encode(np.ascontiguousarray(data, dtype="<" + kind).tobytes()).decode()}


def scene_json(content: ReportContent) -> str:
    """Return the 3-D figure: one mesh whose colour the reader chooses, the path, the indications."""
    assert content.mesh is not None
    mesh = content.cscan.mesh if content.cscan is not None else content.mesh
    keep, faces = thinned(mesh, MOST_VERTICES)
    layers = {name: values[keep] for name, values in _layers(content, mesh).items()}
    traces = [_surface(mesh, keep, faces, layers), *_path(content), *_indications(content)]
    layout = {
        "scene": _view(content, mesh),
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "height": 520,
        "showlegend": True,
        "legend": {"orientation": "h", "y": 0.02, "x": 0.01},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "orientation": "v"},
        "updatemenus": [_menu(layers)] if len(layers) > 1 else [],
    }
    return json.dumps({"data": traces, "layout": layout})


def _view(content: ReportContent, mesh: SurfaceMesh) -> dict[str, Any]:
    """Return axes in true proportion, framed alike for every part: the longest side is two units."""
    shown = mesh.vertices if content.plan is None else np.vstack([mesh.vertices, content.plan.T_part_probe[:, :3, 3]])
    low, high = shown.min(axis=0), shown.max(axis=0)
    rim = 0.02 * float((high - low).max())
    sides = high - low + 2 * rim
    axes = {
        f"{axis}axis": {
            "title": {"text": f"{axis} [mm]"},
            "range": [float(low[k] - rim), float(high[k] + rim)],
            "backgroundcolor": "rgba(0,0,0,0)",
            "showspikes": False,
        }
        for k, axis in enumerate("xyz")
    }
    ratio = {axis: float(2 * sides[k] / sides.max()) for k, axis in enumerate("xyz")}
    return {"aspectmode": "manual", "aspectratio": ratio, "camera": {"eye": {"x": -0.6, "y": -1.6, "z": 1.05}}, **axes}


def _layers(content: ReportContent, mesh: SurfaceMesh) -> dict[str, Array]:
    """Return what the surface may be coloured by; NaN where not covered."""
    layers: dict[str, Array] = {}
    if content.cscan is not None:
        for name, values in content.cscan.channels.items():
            layers[label(name)] = np.where(content.cscan.covered, values, np.nan)
    layers["height [mm]"] = mesh.vertices[:, 2]
    signed = None if content.nominal is None else content.nominal.signed_mm
    if signed is not None and len(signed) == len(mesh.vertices):
        layers["distance to the nominal [mm]"] = signed
    if mesh.uncertainty_mm is not None:
        layers["stated uncertainty [mm]"] = mesh.uncertainty_mm
    return layers


def _colouring(name: str, values: Array) -> dict[str, Any]:
    """Return intensity, limits and scale of one layer; spots without value take the grey foot of the scale."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    known = np.isfinite(values)
    crack = any(word in name for word in CRACK_CHANNELS)
    low, high = np.percentile(values[known], (0.0, 100.0) if crack else (0.5, 99.5)) if known.any() else (0.0, 1.0)
    high = max(float(high), float(low) + 1e-9)
    foot = float(low) - GREY_SHARE * (high - float(low))
    steps = np.linspace(0, 1, 17)
    places = GREY_SHARE + (1 - GREY_SHARE) * (steps**2 if crack else steps)
    scale = [[0.0, GREY], [GREY_SHARE / 2, GREY], [GREY_SHARE / 2, to_hex(colormaps["viridis"](0.0))]]
    scale += [[float(p), to_hex(colormaps["viridis"](s))] for p, s in zip(places, steps, strict=True)]
    shown = np.where(known, np.clip(values, low, None), foot)
    return {"intensity": typed(shown), "cmin": foot, "cmax": high, "colorscale": scale}


def _surface(mesh: SurfaceMesh, keep: IntArray, faces: IntArray, layers: dict[str, Array]) -> dict[str, Any]:
    name, values = next(iter(layers.items()))
    axes = {axis: typed(mesh.vertices[keep, k]) for k, axis in enumerate("xyz")}
    corners = {corner: typed(faces[:, k]) for k, corner in enumerate("ijk")}
    return {
        "type": "mesh3d",
        "name": "surface",
        **axes,
        **corners,
        **_colouring(name, values),
        "colorbar": {"title": {"text": name}, "thickness": 12, "len": 0.7, "outlinewidth": 0},
        "lighting": {"ambient": 0.65, "diffuse": 0.6, "specular": 0.05, "roughness": 0.9},
        "hovertemplate": "x %{x:.2f} · y %{y:.2f} · z %{z:.2f} mm<br>%{intensity:.4g}<extra></extra>",
        "showlegend": False,
    }


def _menu(layers: dict[str, Array]) -> dict[str, Any]:
    buttons = []
    for name, values in layers.items():
        colouring = {key: [value] for key, value in _colouring(name, values).items()}
        change = {**colouring, "colorbar.title.text": name}
        buttons.append({"label": name, "method": "restyle", "args": [change, [0]]})
    return {"buttons": buttons, "x": 0.01, "y": 0.99, "xanchor": "left", "yanchor": "top", "pad": {"t": 4, "l": 4}}


def _path(content: ReportContent) -> list[dict[str, Any]]:
    if content.plan is None:
        return []
    face = content.plan.T_part_probe[:, :3, 3]
    face = face[:: max(1, len(face) // MOST_PATH_POINTS)]
    axes = {axis: typed(face[:, k]) for k, axis in enumerate("xyz")}
    line = {"color": "#d1603d", "width": 2}
    return [
        {
            "type": "scatter3d",
            "mode": "lines",
            "name": "planned path of the coil",
            **axes,
            "line": line,
            "hoverinfo": "skip",
            "visible": True if content.plan.n_rows <= MOST_ROWS else "legendonly",
        }
    ]


def _indications(content: ReportContent) -> list[dict[str, Any]]:
    if not content.indications:
        return []
    centres = np.array([indication.centre_mm for indication in content.indications])
    centres[:, 2] += MARK_ABOVE_MM  # a mark inside the surface would be hidden
    axes = {axis: typed(centres[:, k]) for k, axis in enumerate("xyz")}
    return [
        {
            "type": "scatter3d",
            "mode": "markers+text",
            "name": "indications",
            **axes,
            "text": [str(indication.number) for indication in content.indications],
            "textposition": "top center",
            "marker": {"size": 5, "color": "#e5383b", "symbol": "diamond"},
        }
    ]
