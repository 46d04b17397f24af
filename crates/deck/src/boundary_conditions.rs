//! The boundary conditions of a deck.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::formulas::Displacement;
use super::gates::Checks;
use super::per_axis::array;
use super::quoting::quote;
use super::{AXES, BoxDeck, Expression, GroupDeck, LoadCurve, Vector};

/// A named set of prescribed displacements of nodes or of a surface; its reaction is reported under its name. If
/// several conditions prescribe the displacement of a node along the same axis, those that fix the node share the
/// reaction there equally; if none fixes it, those that move it share the reaction equally.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundaryConditionDeck {
    /// Name, unique among the boundary conditions.
    pub name: String,
    /// Grid nodes on which it acts. Exactly one of `nodes` and `surface` is needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<NodeSelector>,
    /// Name of the surface on which it acts. The condition is then imposed weakly, and prescribes the displacement of
    /// the surface since the start, or since the stage that sets the condition or adds the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["wall"]))]
    pub surface: Option<String>,
    /// Axes along which the nodes or the surface do not move, or the normal of a wall along which they slide: `{normal:
    /// [-0.5, 0.866]}` is a roller on a slope of 30 degrees. For a surface, `normal` stands for the original normal at
    /// each position, so that the surface slides along itself.
    #[serde(default, skip_serializing_if = "FixDeck::is_empty")]
    #[schemars(extend("examples" = [["x", "y"], {"normal": [-0.5, 0.866]}, "normal"]))]
    pub fix: FixDeck,
    /// Penalty stiffness of a condition on a surface, relative to the stiffness of the body over a cell, [-]; 10 by
    /// default. Results do not depend on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6), extend("examples" = [10]))]
    pub penalty: Option<f64>,
    /// Displacement along x at load factor 1, [length]: a number or a formula, which may contain X, Y (the original
    /// position of the material at the node), x, y (the position of the node), in space also Z and z, `factor` (the
    /// load factor), the parameters and the names under `where`. A formula that contains `factor`, directly or through
    /// a name under `where`, states the whole displacement; any other formula is multiplied by the load factor.
    /// Material moves past the nodes from step to step, and each step adds the change in the value of the formula at
    /// the node: use X, Y, Z to prescribe the displacement of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0.1, "gamma*Y"]))]
    pub ux: Option<Expression>,
    /// Displacement along y at load factor 1, [length]: a number or a formula, as for `ux`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0, "-0.1*x*factor^2"]))]
    pub uy: Option<Expression>,
    /// Displacement along z at load factor 1, [length]: a number or a formula, as for `ux`; in space only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0, "-0.1*x*factor^2"]))]
    pub uz: Option<Expression>,
    /// Displacement along a given direction, in place of `ux`, `uy` and `uz`; motion perpendicular to this direction
    /// stays free.
    #[serde(rename = "move", default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{"along": [0.866, 0.5], "by": 0.2}]))]
    pub along: Option<MoveDeck>,
    /// Named intermediate values, in any order, for use in the displacements.
    #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intermediate: BTreeMap<String, Expression>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

/// The directions in which a boundary condition holds its nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FixDeck {
    /// Axes.
    Axes(Vec<Axis>),
    /// The normal of a wall.
    Normal(NormalDeck),
    /// A direction that depends on the position on a surface.
    OnSurface(AlongSurface),
}

/// A direction that depends on the position on a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AlongSurface {
    /// The original normal of the surface.
    Normal,
}

/// The normal of a wall along which nodes slide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NormalDeck {
    /// A vector of any length and either sign.
    #[schemars(with = "Vector", extend("examples" = [[-0.5, 0.866]]))]
    pub normal: Vec<f64>,
}

/// A prescribed displacement along a direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MoveDeck {
    /// The direction, a vector of any length.
    #[schemars(with = "Vector", extend("examples" = [[0.866, 0.5]]))]
    pub along: Vec<f64>,
    /// Displacement along this direction at load factor 1, [length]: a number or a formula, as for `ux`.
    #[schemars(extend("examples" = [0.2]))]
    pub by: Expression,
}

impl Default for FixDeck {
    fn default() -> Self {
        FixDeck::Axes(Vec::new())
    }
}

impl FixDeck {
    fn is_empty(&self) -> bool {
        self.axes().is_empty() && matches!(self, FixDeck::Axes(_))
    }

    /// The axes that `fix` names.
    fn axes(&self) -> &[Axis] {
        match self {
            FixDeck::Axes(axes) => axes,
            FixDeck::Normal(_) | FixDeck::OnSurface(_) => &[],
        }
    }
}

impl BoundaryConditionDeck {
    /// The prescribed displacements, except those that `fix` sets to zero.
    pub fn displacements(&self) -> Vec<Displacement<'_>> {
        let along_axes = [("ux", &self.ux), ("uy", &self.uy), ("uz", &self.uz)].into_iter().enumerate();
        let along_axes = along_axes.filter_map(|(direction, (key, value))| {
            value.as_ref().map(|value| Displacement { key, direction, value })
        });
        let along = self.along.as_ref();
        let along = along.map(|along| Displacement { key: "move/by", direction: 0, value: &along.by });
        along_axes.chain(along).collect()
    }

    /// True if the condition prescribes a displacement other than zero.
    pub fn moves(&self) -> bool {
        self.displacements().iter().any(|displacement| !displacement.value.is_zero())
    }

    /// The direction that the condition states explicitly, if any, with its key.
    fn direction(&self) -> Option<(&'static str, &[f64])> {
        match (&self.fix, &self.along) {
            (FixDeck::Normal(NormalDeck { normal }), _) => Some(("fix/normal", normal)),
            (_, Some(MoveDeck { along, .. })) => Some(("move/along", along)),
            _ => None,
        }
    }

    /// Orthonormal directions, `[direction][axis]`; the first is the direction that the condition states. `None` if it
    /// states none.
    pub(crate) fn frame<const D: usize>(&self) -> Option<[[f64; D]; D]> {
        let (_, direction) = self.direction()?;
        Some(frame(array(direction)))
    }

    /// True if this and another condition prescribe the displacement of the same surface along the same axis, or both
    /// along its normal.
    pub(crate) fn repeats(&self, other: &Self) -> bool {
        let directions = |condition: &Self| match condition.direction() {
            Some(_) => Vec::new(),
            None => {
                let moved = condition.displacements();
                let moved = moved.iter().map(|displacement| displacement.direction);
                condition.held().into_iter().chain(moved).collect::<Vec<_>>()
            }
        };
        let kind = Self::holds_along_surface_normal;
        self.surface.is_some()
            && self.surface == other.surface
            && kind(self) == kind(other)
            && directions(self).iter().any(|direction| directions(other).contains(direction))
    }

    /// True if the condition holds a surface along its normal at every position.
    pub(crate) fn holds_along_surface_normal(&self) -> bool {
        matches!(self.fix, FixDeck::OnSurface(AlongSurface::Normal))
    }

    /// Indices of the directions that `fix` holds: axes, or 0 for a normal.
    pub(crate) fn held(&self) -> Vec<usize> {
        match &self.fix {
            FixDeck::Axes(axes) => axes.iter().map(|axis| *axis as usize).collect(),
            FixDeck::Normal(_) | FixDeck::OnSurface(_) => vec![0],
        }
    }

    /// Checks what the condition prescribes.
    pub(crate) fn check(&self, check: &mut dyn Checks, pointer: &str) {
        let dimensions = check.dimensions();
        let keys = &["`ux`", "`uy`", "`uz`"][..dimensions];
        let displacements = self.displacements();
        if self.fix.is_empty() && displacements.is_empty() {
            let message = format!("the boundary condition {} prescribes nothing", quote(&self.name));
            let help = format!("give at least one of `fix`, {} and `move`", keys.join(", "));
            check.error_at_key("D020", pointer, message, &help);
        }
        self.check_place(check, pointer);
        if let Some((key, direction)) = self.direction() {
            self.check_direction(check, &format!("{pointer}/{key}"), key, direction);
        }
        if self.holds_along_surface_normal() && !displacements.is_empty() {
            self.refuse_second_direction(check, &format!("{pointer}/fix"));
        }
        for (index, &axis) in self.fix.axes().iter().enumerate() {
            let at = format!("{pointer}/fix/{index}");
            let name = AXES[axis as usize];
            let moved = displacements.iter().find(|given| given.key == ["ux", "uy", "uz"][axis as usize]);
            if axis as usize >= dimensions {
                check.wrong_dimension(&at, &format!("the axis `{name}`"), 3);
            } else if self.fix.axes()[..index].contains(&axis) {
                check.error(
                    "D020",
                    &at,
                    format!("the axis `{name}` is fixed twice"),
                    "remove one of the two",
                );
            } else if let Some(Displacement { key, .. }) = moved {
                let message = format!("the axis `{name}` is fixed and also moved by `{key}`");
                let help = format!("remove it from `fix`, or remove `{key}`");
                check.error("D020", &at, message, &help);
            }
        }
        if self.uz.is_some() && dimensions < 3 {
            check.wrong_dimension(&format!("{pointer}/uz"), "the displacement `uz`", 3);
        }
        check.formulas_at_nodes(pointer, displacements, &self.intermediate);
    }

    /// Checks what depends on whether the condition acts on nodes or on a surface.
    fn check_place(&self, check: &mut dyn Checks, pointer: &str) {
        let name = quote(&self.name);
        let message = match (&self.nodes, &self.surface) {
            (Some(_), None) => None,
            (None, Some(surface)) => {
                check.surface(&format!("{pointer}/surface"), surface);
                return;
            }
            (None, None) => Some(format!("the boundary condition {name} acts nowhere")),
            (Some(_), Some(_)) => {
                Some(format!("the boundary condition {name} acts on nodes and on a surface"))
            }
        };
        if let Some(message) = message {
            check.error_at_key("D019", pointer, message, "give exactly one of: `nodes`, `surface`");
            return;
        }
        if self.penalty.is_some() {
            let help = "remove it; it belongs to a condition on a `surface`";
            let message = "`penalty` has no effect on nodes".to_owned();
            check.error("D020", &format!("{pointer}/penalty"), message, help);
        }
        if self.holds_along_surface_normal() {
            let message = "only a surface has a normal".to_owned();
            let help =
                "give the direction, such as `fix: {normal: [0, 1]}`, or use a `surface` instead of `nodes`";
            check.error("D020", &format!("{pointer}/fix"), message, help);
        }
    }

    /// Checks the direction of a wall or of a motion.
    fn check_direction(&self, check: &mut dyn Checks, pointer: &str, key: &str, direction: &[f64]) {
        if let Some(direction) = check.vector(pointer, direction)
            && (length(&direction) == 0.0 || !length(&direction).is_finite())
        {
            let message =
                format!("the length of this vector is {}, so it has no direction", length(&direction));
            check.error("D020", pointer, message, "give a vector whose length is finite and not zero");
        }
        let along_axes =
            !self.fix.axes().is_empty() || self.displacements().iter().any(|d| d.key != "move/by");
        if along_axes || (key == "fix/normal" && self.along.is_some()) {
            self.refuse_second_direction(check, pointer);
        }
    }

    fn refuse_second_direction(&self, check: &mut dyn Checks, pointer: &str) {
        let message = format!(
            "the boundary condition {} states a direction, and also prescribes a displacement along another one",
            quote(&self.name)
        );
        let place = if self.surface.is_some() { "surface" } else { "nodes" };
        let help =
            format!("divide it into two boundary conditions on the same {place}, each with its own name");
        check.error("D020", pointer, message, &help);
    }
}

fn length(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Orthonormal vectors, the first of them along `first`, which must not be zero.
fn frame<const D: usize>(first: [f64; D]) -> [[f64; D]; D] {
    let mut found = [[0.0; D]; D];
    let unit = |vector: [f64; D]| vector.map(|x| x / length(&vector));
    found[0] = unit(unit(first)); // twice, to be exact to the last bit
    // The axes that are most nearly orthogonal to the first vector span the rest.
    let mut axes: Vec<usize> = (0..D).collect();
    axes.sort_by(|&a, &b| found[0][a].abs().total_cmp(&found[0][b].abs()));
    for k in 1..D {
        let mut next = std::array::from_fn(|d| f64::from(u8::from(d == axes[k - 1])));
        for before in &found[..k] {
            let along: f64 = (0..D).map(|d| before[d] * next[d]).sum();
            next = std::array::from_fn(|d| next[d] - along * before[d]);
        }
        found[k] = unit(next);
    }
    found
}

/// A coordinate axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// The first axis.
    X,
    /// The second axis.
    Y,
    /// The third axis, in space.
    Z,
}

/// Selection of grid nodes in exactly one way: by coordinates (`{x: 0}` is a line, in space a plane; `{x: 0, y: 9.5}`
/// is a point, in space a line), by a box, by a physical group of a gmsh grid, or by the outer layer of a body's
/// points.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NodeSelector {
    /// Nodes with this x coordinate, [length].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<f64>,
    /// Nodes with this y coordinate, [length].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<f64>,
    /// Nodes with this z coordinate, [length]; in space only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub z: Option<f64>,
    /// Nodes inside this box, its boundary included.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub within: Option<BoxDeck>,
    /// Name of a physical group of a gmsh grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<GroupDeck>,
    /// Name of a body: selects all nodes of the grid cells that contain a point of its outer layer or, if the point has
    /// a domain, overlap that domain. The layer is determined at the start; the nodes are selected anew at each load
    /// step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outer_layer: Option<String>,
}

impl NodeSelector {
    /// The stated coordinates.
    pub fn coordinates(&self) -> [Option<f64>; 3] {
        [self.x, self.y, self.z]
    }
}
