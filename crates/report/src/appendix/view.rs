//! The view of bodies in space: a parallel projection, from above, with z upwards. Faces turned away from the viewer
//! are left out, and the others are drawn from the farthest to the nearest, darker the more they face away from the
//! light.

/// Direction of the viewer: angle from x towards y in the horizontal plane, and elevation above it, [degree]. Walls at
/// the smallest y and at the largest x are visible.
const AZIMUTH: f64 = -52.0;
const ELEVATION: f64 = 24.0;
/// Direction towards the light.
const LIGHT: [f64; 3] = [0.25, -0.55, 0.8];
/// Brightness of a face that faces away from the light.
const DARKEST: f64 = 0.62;

/// Faces of a cell, one constant for each cell shape that occurs in a file; the corners are numbered as in VTK and
/// listed counterclockwise as seen from outside.
const FACES_OF_TETRAHEDRON: [&[usize]; 4] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
const FACES_OF_HEXAHEDRON: [&[usize]; 6] =
    [&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];

/// The directions of the picture: to the right, upwards, and towards the viewer.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
    light: [f64; 3],
}

/// A face in the picture.
#[derive(Debug, Clone)]
pub(super) struct Face {
    /// Corners of the face in the picture.
    pub corners: Vec<[f64; 2]>,
    /// Brightness, at most 1.
    pub shade: f64,
    /// Mean, over the corners, of the coordinate along the axis towards the viewer.
    pub depth: f64,
}

impl View {
    /// The view of all pictures.
    pub fn new() -> View {
        let (azimuth, elevation) = (AZIMUTH.to_radians(), ELEVATION.to_radians());
        let towards = [azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin()];
        let right = [-azimuth.sin(), azimuth.cos(), 0.0];
        let length = dot(LIGHT, LIGHT).sqrt();
        View { right, up: cross(towards, right), towards, light: LIGHT.map(|c| c / length) }
    }

    /// Projects a position onto the plane of the picture.
    pub fn project(&self, place: [f64; 3]) -> [f64; 2] {
        [dot(self.right, place), dot(self.up, place)]
    }

    /// The faces of a cell that are turned towards the viewer; empty for a cell that has neither four nor eight
    /// corners.
    pub fn faces(&self, corners: &[[f64; 3]]) -> Vec<Face> {
        let faces: &[&[usize]] = match corners.len() {
            4 => &FACES_OF_TETRAHEDRON,
            8 => &FACES_OF_HEXAHEDRON,
            _ => &[],
        };
        faces.iter().filter_map(|face| self.face(face.iter().map(|&k| corners[k]).collect())).collect()
    }

    /// The faces, turned towards the viewer, of a cube with its edges along the axes.
    pub fn cube(&self, centre: [f64; 3], side: f64) -> Vec<Face> {
        let corner = |k: usize| {
            // The corners of a face are in order around it.
            let sign = [[0, 3, 4, 7].contains(&k), [0, 1, 4, 5].contains(&k), k < 4];
            std::array::from_fn(|d| centre[d] + if sign[d] { -0.5 * side } else { 0.5 * side })
        };
        self.faces(&(0..8).map(corner).collect::<Vec<[f64; 3]>>())
    }

    fn face(&self, corners: Vec<[f64; 3]>) -> Option<Face> {
        // Normal from two diagonals, or from two sides of a triangle.
        let last = corners.len() - 1;
        let normal = cross(minus(corners[2], corners[0]), minus(corners[last], corners[1]));
        let length = dot(normal, normal).sqrt();
        let facing = dot(normal, self.towards);
        (facing > 0.0 && length > 0.0).then(|| {
            let bright = (dot(normal, self.light) / length).max(0.0);
            let depth = corners.iter().map(|c| dot(*c, self.towards)).sum::<f64>() / corners.len() as f64;
            let corners = corners.iter().map(|c| self.project(*c)).collect();
            Face { corners, shade: DARKEST + (1.0 - DARKEST) * bright, depth }
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_is_a_rotation_with_z_upwards() {
        let view = View::new();
        for (a, b) in [(view.right, view.up), (view.up, view.towards), (view.towards, view.right)] {
            assert!(dot(a, b).abs() < 1e-15 && (dot(a, a) - 1.0).abs() < 1e-15);
        }
        let [x, y] = view.project([0.0, 0.0, 1.0]);
        assert!(x == 0.0 && y > 0.9);
    }

    #[test]
    fn three_faces_of_a_cube_are_seen_and_they_cover_what_it_covers() {
        let view = View::new();
        let faces = view.cube([1.0, 2.0, 3.0], 2.0);
        assert_eq!(faces.len(), 3);
        let area = |corners: &[[f64; 2]]| {
            let n = corners.len();
            let part = |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % n]);
                0.5 * (a[0] * b[1] - a[1] * b[0])
            };
            (0..n).map(part).sum::<f64>()
        };
        let seen: f64 = faces.iter().map(|face| area(&face.corners)).sum();
        let exact = 4.0 * view.towards.iter().map(|c| c.abs()).sum::<f64>();
        assert!((seen - exact).abs() < 1e-13, "{seen} {exact}");
        let depth = |sign: [f64; 3]| dot([1.0 + sign[0], 2.0 + sign[1], 3.0 + sign[2]], view.towards);
        for (expected, nearest) in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]].map(|s| (depth(s), s))
        {
            assert!(faces.iter().any(|face| (face.depth - expected).abs() < 1e-14), "{nearest:?}");
        }
        assert!(faces.iter().all(|face| (DARKEST..=1.0).contains(&face.shade)));
    }

    #[test]
    fn the_faces_of_a_tetrahedron_close_it() {
        let view = View::new();
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // Seen from two opposite sides, each face is visible once.
        let mirrored = corners.map(|c| c.map(|x| -x));
        let turned = [mirrored[0], mirrored[2], mirrored[1], mirrored[3]];
        assert_eq!(view.faces(&corners).len() + view.faces(&turned).len(), 4);
        assert!(view.faces(&corners[..3]).is_empty());
    }
}
