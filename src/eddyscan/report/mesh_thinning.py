"""A lighter mesh for looking at: vertices in one cell of a grid become one."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import IntArray
from eddyscan.core.mesh import SurfaceMesh


def thinned(mesh: SurfaceMesh, most_vertices: int) -> tuple[IntArray, IntArray]:
    """Return vertex numbers to keep (K,) and faces (G, 3) among the kept ones.

    Vertex clustering (Rossignac and Borrel 1993): the grid grows until at most
    `most_vertices` cells hold a vertex; the vertex nearest its cell's mean stays,
    one on the mesh's border before all others, so that the outline stays straight.
    """
    everything = np.arange(len(mesh.vertices))
    if len(everything) <= most_vertices:
        return everything, mesh.faces
    cell_mm = np.sqrt(mesh.area_mm2 / most_vertices)
    while True:
        low = mesh.vertices.min(axis=0)
        cells = np.floor((mesh.vertices - low) / cell_mm).astype(np.int64)
        _, cluster = np.unique(cells, axis=0, return_inverse=True)
        cluster = cluster.ravel()
        count = int(cluster.max()) + 1
        if count <= most_vertices:
            break
        cell_mm *= 1.1
    size = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, mesh.vertices[:, k]) / size for k in range(3)], axis=1)
    away = np.linalg.norm(mesh.vertices - mean[cluster], axis=1)
    away[on_border(mesh.faces)] -= 10 * cell_mm
    order = np.lexsort((away, cluster))
    keep = order[np.concatenate([[True], np.diff(cluster[order]) > 0])]
    faces = cluster[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return keep, np.unique(faces[whole], axis=0)


def on_border(faces: IntArray) -> IntArray:
    """Return the numbers of the vertices on an edge that only one face has."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])
