"""Recomputes the residual of eq. (40) of every written step from the files of a run alone, independently of the program:
points, their domains and the grid give the internal force; the deck gives loads, supports and grid.

Plane strain, standard points and GIMP on a square structured grid, gravity and body forces that grow with time.
"""

import pathlib

import numpy as np
import pyvista

ON_LINE = 1e-8
SLIVER = 1e-8


def coordinate(x, h):
    """In units of cells; what lies on a grid line within ON_LINE is put on it."""
    xi = x / h
    line = np.round(xi)
    return line if abs(xi - line) < ON_LINE else xi


def line_of(x, half, h, cells):
    """First node, values and slopes along one axis: hat functions, or their means over a domain."""
    if half == 0.0:
        xi = coordinate(x, h)
        cell = min(int(xi), cells - 1)
        return cell, np.array([1 - (xi - cell), xi - cell]), np.array([-1, 1]) / h
    a, b = coordinate(x - half, h), coordinate(x + half, h)
    first, last = int(np.floor(a)), max(int(np.ceil(b)) - 1, int(np.floor(a)))
    value, slope = np.zeros(last - first + 2), np.zeros(last - first + 2)
    for cell in range(first, last + 1):
        low, high = max(a, cell), min(b, cell + 1)
        share, xi = (high - low) / (b - a), 0.5 * (low + high) - cell
        k = cell - first
        value[k : k + 2] += share * np.array([1 - xi, xi])
        slope[k : k + 2] += share * np.array([-1, 1]) / h
    keep = [(k, first + k) for k in range(len(value)) if 0 <= first + k <= cells]
    return keep[0][1], value[[k for k, _ in keep]], slope[[k for k, _ in keep]]


def supports(positions, halves, h, cells):
    """For each point its nodes, values and gradients, without nodes that only slivers touch."""
    n = cells + 1
    found, holds = [], {}
    for x, half in zip(positions, halves):
        (i, vx, sx), (j, vy, sy) = (line_of(x[d], half[d], h, cells) for d in range(2))
        nodes = [(i + p) + n * (j + q) for q in range(len(vy)) for p in range(len(vx))]
        value = np.outer(vy, vx).ravel()
        gradient = np.stack([np.outer(vy, sx).ravel(), np.outer(sy, vx).ravel()], axis=1)
        strong = (np.abs(value) >= SLIVER) | (np.abs(gradient) * h >= SLIVER).any(axis=1)
        for node, is_strong in zip(nodes, strong):
            holds[node] = holds.get(node, False) or bool(is_strong)
        found.append((np.array(nodes), value, gradient))
    kept = []
    for nodes, value, gradient in found:
        weak = np.array([not holds[node] for node in nodes])
        if weak.any():
            # A sliver node moves as the field of the point says, from the node that the point touches most.
            most = np.argmax(value)
            places = h * np.stack([nodes % n, nodes // n], axis=1)
            weights = (places[weak] - places[most]) @ gradient.T
            weights[:, most] += 1.0
            value, gradient = value + weights.T @ value[weak], gradient + weights.T @ gradient[weak]
            nodes, value, gradient = nodes[~weak], value[~weak], gradient[~weak]
        kept.append((nodes, value, gradient))
    return kept


def parts_of(links):
    """The lowest node of the connected part of each node."""
    root = {}

    def find(node):
        while root.setdefault(node, node) != node:
            root[node] = root[root[node]]
            node = root[node]
        return node

    for nodes, _, _ in links:
        for a, b in zip(nodes[:-1], nodes[1:]):
            a, b = find(a), find(b)
            root[max(a, b)] = min(a, b)
    return {node: find(node) for node in root}


def read(folder, name, step):
    return pyvista.read(pathlib.Path(folder) / f"{name}_{step:04d}.vtu")


def halves_of(folder, step, n, method):
    """Half lengths of the domains in the order of the points."""
    if method == "mpm":
        return np.zeros((n, 2))
    mesh = read(folder, "domains", step)
    corners = mesh.points[mesh.cells_dict[9]][:, :, :2]
    return 0.5 * (corners.max(axis=1) - corners.min(axis=1))


def residuals_of_parts(folder, step, factor, problem):
    """For each connected part: |out of balance| on what is free, and |loads and reactions|, of a written step.

    `problem`: h, cells, method, held(x, y) -> [bool, bool], per_volume: the body force of each body.
    """
    before, after = read(folder, "points", step - 1), read(folder, "points", step)
    h, cells, method = problem["h"], problem["cells"], problem["method"]
    positions = np.asarray(before.points)[:, :2]
    links = supports(positions, halves_of(folder, step - 1, len(positions), method), h, cells)
    old, new = (m["deformation_gradient"].reshape(-1, 3, 3) for m in (before, after))
    jacobian, original = np.linalg.det(new), before["volume"] / np.linalg.det(old)
    # Symmetric tensors have six components in the order of VTK: xx, yy, zz, xy, yz, xz.
    xx, yy, _, xy, _, _ = after["cauchy_stress"].T * jacobian
    tau = np.stack([np.stack([xx, xy], axis=1), np.stack([xy, yy], axis=1)], axis=1)
    n = (cells + 1) ** 2
    internal, external = np.zeros((n, 2)), np.zeros((n, 2))
    for p, (nodes, value, gradient) in enumerate(links):
        increment = new[p] @ np.linalg.inv(old[p])
        spatial = gradient @ np.linalg.inv(increment[:2, :2])
        np.add.at(internal, nodes, original[p] * spatial @ tau[p])
        body = int(before["body_id"][p])
        load = factor * (np.array(problem["per_volume"][body]) * before["volume"][p])
        np.add.at(external, nodes, np.outer(value, load))
    part = parts_of(links)
    sums = {}
    for node, lowest in part.items():
        held = problem["held"]((node % (cells + 1)) * h, (node // (cells + 1)) * h)
        for d in range(2):
            out = 0.0 if held[d] else external[node, d] - internal[node, d]
            force = internal[node, d] if held[d] else external[node, d]
            sums.setdefault(lowest, np.zeros(2))
            sums[lowest] += [out**2, force**2]
    return [np.sqrt(s) for s in sums.values()]
