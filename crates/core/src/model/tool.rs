//! Rigid tools that touch the bodies.

use std::sync::Arc;

use crate::formula::Formula;
use crate::grid::Grid;
use crate::tool::{NoOutline, Outline, Pose, Shape};

use super::load::LoadCurve;
use super::tool_part::ToolPart;

/// Largest number of times that the facet size of an outline is doubled to reduce the number of facets.
const COARSER: usize = 20;
/// Half width of the portion of an unbounded tool in which its named parts are sought, relative to the diagonal of the
/// grid, [-].
const SOUGHT: f64 = 2.0;

/// A rigid tool, which no body can penetrate. It moves as prescribed, or as its loads and the contact with the bodies
/// determine.
#[derive(Debug, Clone)]
pub struct Tool<const D: usize> {
    /// Name under which its forces are reported.
    pub name: String,
    /// Shape in the frame of the tool. The origin of the frame is the reference point.
    pub shape: Arc<dyn Shape<D>>,
    /// Pose at the start of the analysis.
    pub pose: Pose<D>,
    /// Motion of the reference point along each global axis.
    pub translation: [Freedom; D],
    /// Rotation about the global axes x, y and z. In the plane, only the rotation about z is used.
    pub rotation: [Freedom; 3],
    /// Load factor of the prescribed motion over time.
    pub curve: LoadCurve,
    /// External forces on the tool, which move it along its free components.
    pub loads: Vec<ToolLoad<D>>,
    /// Interface with the bodies that `pairs` does not list; `None` if the tool has no contact with them.
    pub interface: Option<Interface>,
    /// Interfaces with individual bodies, by body index; `None` if the tool has no contact with the body.
    pub pairs: Vec<(usize, Option<Interface>)>,
    /// Control of the contact.
    pub control: ContactControl,
    /// Named parts of the surface of the tool; the forces on each part are summed separately.
    pub parts: Vec<ToolPart<D>>,
}

/// One component of the motion of a tool.
#[derive(Debug, Clone)]
pub enum Freedom {
    /// The displacement, [length], or rotation, [rad], since time 0, as a formula in the load factor and the time, in
    /// this order; a formula that depends on neither is multiplied by the load factor. In space, three prescribed
    /// rotations are the components of a rotation vector.
    Prescribed(Formula),
    /// The component follows from equilibrium.
    Free,
}

/// An external force on a tool, such as its weight, with a fixed direction.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolLoad<const D: usize> {
    /// Force at load factor 1, [force]; over the full circle for bodies of revolution, per unit thickness in plane
    /// strain.
    pub force: [f64; D],
    /// Moment about the reference point, in global axes, at load factor 1, [force·length].
    pub moment: [f64; 3],
    /// Load factor over time.
    pub curve: LoadCurve,
}

/// The interface between a tool and a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Resistance to sliding.
    pub shear: Shear,
    /// Largest tension, [stress]. Tension can act from the first contact of the surfaces until they separate.
    pub tension_cut_off: f64,
}

/// The resistance of an interface to sliding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shear {
    /// The surfaces stick as long as they touch. Where they are about to separate, the shear stress is limited to ten
    /// times the sum of the pressure and the tension cut-off, so that forces change continuously.
    Rough,
    /// The shear stress is limited to `adhesion + friction · p` at the pressure p. Where the surfaces are about to
    /// separate, it is also limited to `1 + friction` times the sum of the pressure and the tension cut-off.
    Coulomb {
        /// Coefficient of friction, [-].
        friction: f64,
        /// Shear strength at zero pressure, [stress].
        adhesion: f64,
    },
}

impl Interface {
    /// An interface that transfers pressure only.
    pub const SMOOTH: Interface = Interface::with_friction(0.0);

    /// An interface with Coulomb friction only.
    pub const fn with_friction(friction: f64) -> Interface {
        Interface { shear: Shear::Coulomb { friction, adhesion: 0.0 }, tension_cut_off: 0.0 }
    }

    /// An interface on which the surfaces stick as long as they touch, and separate freely.
    pub const ROUGH: Interface = Interface { shear: Shear::Rough, tension_cut_off: 0.0 };

    /// True if a shear stress can act on the interface.
    pub fn resists_sliding(&self) -> bool {
        self.shear != Shear::Coulomb { friction: 0.0, adhesion: 0.0 }
    }
}

/// Control of the contact of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactControl {
    /// Penalty stiffness per unit area, as a multiple of 4G/h, with the shear modulus G of the body and the cell size
    /// h, [-]. It affects the number of iterations; results do not depend on it.
    pub penalty: f64,
    /// Largest overlap, and largest slip of sticking contact points, in a converged step, as a mean over the
    /// contact points around a node, relative to the cell size, [-]. Where constraints conflict, the mean may reach
    /// 10⁻⁴, or 10⁻³ after six updates of the multipliers. A single contact point may always keep up to 10⁻³.
    pub tolerance: f64,
    /// Largest motion of a touching contact point relative to the tool in a step, as a fraction of the cell size, [-].
    pub largest_slide: f64,
    /// Largest number of updates of the multipliers in a step.
    pub augmentations: usize,
}

impl Default for ContactControl {
    fn default() -> Self {
        ContactControl { penalty: 100.0, tolerance: 1e-6, largest_slide: 0.5, augmentations: 20 }
    }
}

impl Freedom {
    /// The component does not move.
    pub fn fixed() -> Freedom {
        Freedom::Prescribed(Formula::constant(0.0))
    }

    /// True if the component is free.
    pub fn is_free(&self) -> bool {
        matches!(self, Freedom::Free)
    }

    /// True if the component does not move at all.
    pub fn is_fixed(&self) -> bool {
        matches!(self, Freedom::Prescribed(formula) if formula.as_constant() == Some(0.0))
    }

    /// The prescribed value at a load factor and a time, [length] or [rad]; 0 for a free component.
    pub fn value(&self, factor: f64, time: f64) -> f64 {
        let Freedom::Prescribed(formula) = self else { return 0.0 };
        let value = formula.evaluate(&[factor, time]);
        if formula.depends_on(0) || formula.depends_on(1) { value } else { value * factor }
    }
}

impl<const D: usize> Tool<D> {
    /// A smooth tool that does not move.
    pub fn new(name: impl Into<String>, shape: impl Shape<D> + 'static, pose: Pose<D>) -> Self {
        Tool {
            name: name.into(),
            shape: Arc::new(shape),
            pose,
            translation: std::array::from_fn(|_| Freedom::fixed()),
            rotation: std::array::from_fn(|_| Freedom::fixed()),
            curve: LoadCurve::ramp(1.0),
            loads: Vec::new(),
            interface: Some(Interface::SMOOTH),
            pairs: Vec::new(),
            control: ContactControl::default(),
            parts: Vec::new(),
        }
    }

    /// Component `k` of the motion of the tool: the translations, then the rotations about x, y and z.
    pub fn freedom(&self, k: usize) -> &Freedom {
        if k < D { &self.translation[k] } else { &self.rotation[(k - D) % 3] }
    }

    /// The components in use: in the plane, only one rotation.
    pub fn components() -> impl Iterator<Item = usize> {
        (0..D + 3).filter(|&k| k < D || D == 3 || k == D + 2)
    }

    /// Component `k` of the motion of a tool, with its preposition.
    pub fn component_name(k: usize) -> &'static str {
        let names = [
            "along x",
            "along y",
            "along z",
            "in rotation about x",
            "in rotation about y",
            "in rotation about z",
        ];
        names[if k < D { k } else { (k + 3 - D) % 6 }]
    }

    /// The interface with a body; `None` if the tool has no contact with it.
    pub fn interface_with(&self, body: usize) -> Option<Interface> {
        let listed = self.pairs.iter().find(|(number, _)| *number == body);
        listed.map_or(self.interface, |(_, interface)| *interface)
    }

    /// True if a shear stress can act between the tool and a body.
    pub fn resists_sliding(&self) -> bool {
        let listed = self.pairs.iter().filter_map(|(_, interface)| *interface);
        self.interface.into_iter().chain(listed).any(|interface| interface.resists_sliding())
    }

    /// True if component `k` of the motion of the tool is prescribed and is not always 0.
    pub fn is_driven(&self, k: usize) -> bool {
        !self.freedom(k).is_free() && !self.freedom(k).is_fixed()
    }

    /// The curves of the motion of the tool and of the loads on it.
    pub fn curves(&self) -> impl Iterator<Item = &LoadCurve> {
        self.loads.iter().map(|load| &load.curve).chain([&self.curve])
    }

    /// Force and moment of the loads on the tool, with a factor for each curve, [force] and [force·length].
    pub fn load_at(&self, factor: impl Fn(&LoadCurve) -> f64) -> ([f64; D], [f64; 3]) {
        let (mut force, mut moment) = ([0.0; D], [0.0; 3]);
        for load in &self.loads {
            let factor = factor(&load.curve);
            (0..D).for_each(|d| force[d] += factor * load.force[d]);
            (0..3).for_each(|d| moment[d] += factor * load.moment[d]);
        }
        (force, moment)
    }
}

impl<const D: usize> Tool<D> {
    /// The surface in the frame of the tool, divided into facets of the size of the grid cells where the tool starts,
    /// or larger ones if there would be too many. For an unbounded tool, only a segment (square) of the surface around
    /// the foot of the perpendicular from the reference point; its half width is `width` times the diagonal of the
    /// grid. Empty if the shape has no outline.
    pub fn outline(&self, grid: &dyn Grid<D>, width: f64) -> Outline<D> {
        let [low, high] = grid.bounds();
        let width = width * (0..D).map(|d| (high[d] - low[d]).powi(2)).sum::<f64>().sqrt();
        let mut size = grid.size(grid.nearest_cell(&self.pose.position()) as usize);
        let mut outline = self.shape.outline_near([0.0; D], width, size);
        for _ in 0..COARSER {
            if outline != Err(NoOutline::TooMany) {
                break;
            }
            size *= 2.0;
            outline = self.shape.outline_near([0.0; D], width, size);
        }
        outline.unwrap_or_default()
    }

    /// The indices of the named parts to which a position on the surface of the tool belongs. The position is given by
    /// the index of the side and by coordinates in the frame of the tool, [length].
    pub fn parts_at(&self, side: usize, x: &[f64; D]) -> impl Iterator<Item = usize> {
        let at_start = self.pose.to_space(x);
        self.parts.iter().enumerate().filter(move |(_, part)| part.holds(side, &at_start)).map(|(k, _)| k)
    }

    /// True if the sides of a part reach into its box, judged by the bounding boxes of facets of about the size of the
    /// grid cells.
    pub fn reaches_into(&self, part: &ToolPart<D>, grid: &dyn Grid<D>) -> bool {
        let Outline { vertices, facets, parts, .. } = self.outline(grid, SOUGHT);
        facets.iter().zip(&parts).any(|(facet, side)| {
            let mut around = [[f64::INFINITY; D], [f64::NEG_INFINITY; D]];
            for &vertex in facet {
                let x = self.pose.to_space(&vertices[vertex as usize]);
                for d in 0..D {
                    around[0][d] = around[0][d].min(x[d]);
                    around[1][d] = around[1][d].max(x[d]);
                }
            }
            part.has_side(*side) && part.reaches(&around)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Tool, ToolPart};
    use crate::grid::Structured;
    use crate::region::Brick;
    use crate::tool::{HalfSpace, Pose};
    use std::f64::consts::FRAC_PI_2;

    fn part(sides: Option<Vec<usize>>, bounds: Option<[[f64; 2]; 2]>) -> ToolPart<2> {
        ToolPart { name: "tip".to_owned(), sides, bounds }
    }

    #[test]
    fn parts_are_selected_at_the_start() {
        // A bar along x, turned upright about (1, 5): it stands at 0.75 < x < 1.25, 4 < y < 6.
        let pose = Pose::new([1.0, 5.0], [0.0, 0.0, FRAC_PI_2]).unwrap();
        let mut tool = Tool::new("bar", Brick::new([-1.0, -0.25], [1.0, 0.25]).unwrap(), pose);
        let lower = Some([[0.0, 4.0], [2.0, 4.5]]);
        tool.parts = vec![part(None, lower), part(Some(vec![3]), None), part(Some(vec![0]), lower)];
        let parts = |side: usize, x: [f64; 2]| tool.parts_at(side, &x).collect::<Vec<_>>();
        assert_eq!(parts(3, [-1.0, 0.0]), [0, 1]);
        assert_eq!(parts(0, [-0.5, -0.25]), [0, 2]);
        assert_eq!(parts(0, [-0.49, -0.25]), [0usize; 0]);
        let grid = Structured::new([0.0; 2], [0.25; 2], [8, 40]);
        assert!(tool.parts.iter().all(|part| tool.reaches_into(part, &grid)));
        assert!(!tool.reaches_into(&part(Some(vec![4]), None), &grid));
        assert!(!tool.reaches_into(&part(None, Some([[0.8, 4.1], [1.2, 5.9]])), &grid));
        assert!(!tool.reaches_into(&part(Some(vec![1]), lower), &grid));
    }

    #[test]
    fn unbounded_tools_have_parts_in_the_grid() {
        let pose = Pose::new([0.0, 3.0], [0.0; 3]).unwrap();
        let tool = Tool::new("roof", HalfSpace::new([0.0; 2], [0.0, -1.0]).unwrap(), pose);
        let grid = Structured::new([0.0; 2], [0.5; 2], [20, 8]);
        assert!(tool.reaches_into(&part(None, Some([[8.0, 2.0], [9.0, 4.0]])), &grid));
        assert!(!tool.reaches_into(&part(None, Some([[8.0, 0.0], [9.0, 2.9]])), &grid));
    }
}
