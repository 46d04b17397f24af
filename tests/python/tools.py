"""A deck with a tool that has parts, and a load and a probe whose columns are of the same kinds."""

PLOUGH = {
    "version": 1,
    "title": "A plough in rubber",
    "grid": {"type": "structured", "origin": [0, 0], "size": [6, 5], "spacing": 0.5},
    "materials": {"rubber": {"model": "hencky", "young": 1e6, "poisson": 0.3, "density": 1000}},
    "bodies": [
        {
            "name": "ground",
            "material": "rubber",
            "method": "gimp",
            "points_per_cell": 2,
            "shape": {"type": "box", "min": [0, 0], "max": [6, 3]},
        }
    ],
    "boundary_conditions": [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}],
    "loads": [{"name": "weight", "type": "gravity", "acceleration": [0, -1]}],
    "tools": [
        {
            "name": "plough",
            "shape": {"type": "polygon", "vertices": [[3, 3], [4.5, 3.5], [4.5, 4.5], [2, 4.5]]},
            "reference": [3, 3],
            "ux": 0.05,
            "uy": -0.2,
            "friction": 0.3,
            "parts": {"right": {"edges": [0, 1]}, "left": {"edges": [3]}, "far": {"edges": [2]}},
        }
    ],
    "output": {"probes": [{"name": "under", "body": "ground", "nearest": [3, 2]}]},
    "steps": {"count": 4},
}
