//! The fields of the points, each declared once.

use super::declare::point_fields;
use crate::tensor::{Mat3, Sym3};

point_fields! {
    /// All material points of an analysis, as a structure of arrays.
    ///
    /// Newton iterations write only `trial`, and only [`Points::commit`] makes it the converged state; an abandoned
    /// load step therefore leaves nothing to undo. Points are kept grouped by the grid cell that holds them; `id` is
    /// the permanent number of a point.
    struct Points {
        counts {
            /// Number of history variables kept per point: the largest number that any law needs.
            history_len = |seed| seed.history.len();
            /// Number of domain corners stored per point: the largest number that any point has.
            corners_per_point = |seed| seed.corners.len();
        }
        fixed {
            /// Body number.
            body: u16 = one(|seed| seed.body), in "-";
            /// Original position X.
            original_position: [f64; D] = one(|seed| seed.position), in "length";
            /// Original half lengths l_p0 of the domain; empty if no point has half lengths.
            original_half_lengths: [f64; D] = one_or_none(|seed| seed.half_lengths), in "length";
            /// Original corners of domains given by corners; the corners of a point are at [`Points::corner_range`].
            original_corners: [f64; D] = up_to[corners_per_point](|seed| &seed.corners), in "length";
            /// Original volume V_p0.
            original_volume: f64 = one(|seed| seed.volume), in "volume";
            /// Mass m_p.
            mass: f64 = one(|seed| seed.mass), in "mass";
            /// True if the point belongs to the outer layer of its body at the start.
            outer_layer: bool = one(|seed| seed.outer_layer), in "-";
            /// Number of corners of the domain of the point: 2^D for quadrilaterals and hexahedra, D + 1 for triangles
            /// and tetrahedra, 0 for points whose domain is not given by corners. Empty if no point has corners.
            corner_count: u8 = one_or_none(|seed| seed.corners.len() as u8), in "-";
        }
    }

    /// The fields of the points that change from step to step.
    struct State {
        motion {
            /// Position x_p.
            position: [f64; D] = one(|seed| seed.position), in "length", called "position";
            /// Half lengths l_p of the domain along the axes, or of the box with which a standard point touches tools;
            /// zero for points without half lengths, and empty if no point has any.
            half_lengths: [f64; D] = one_or_none(|seed| seed.half_lengths), in "length", called "half length";
            /// Corners of domains given by corners; the corners of a point are at [`Points::corner_range`].
            corners: [f64; D] = up_to[corners_per_point](|seed| &seed.corners), in "length", called "domain";
            /// Deformation gradient F from the original configuration.
            deformation_gradient: Mat3 = one(|_| Mat3::identity()), in "-", called "deformation gradient";
        }
        answer {
            /// Elastic strain in the strain measure of the law; for most laws, the logarithmic strain ε^e.
            elastic_strain: Sym3 = one(|_| Sym3::ZERO), in "-", called "elastic strain";
            /// Kirchhoff stress τ.
            kirchhoff_stress: Sym3 = one(|_| Sym3::ZERO), in "stress", called "Kirchhoff stress";
            /// History variables of the law, [`Points::history_len`] per point.
            history: f64 = up_to[history_len](|seed| &seed.history), in "-", called "history";
        }
    }
}
