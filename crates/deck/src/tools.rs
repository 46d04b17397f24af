//! The rigid tools of a deck.

mod tool_shape;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BoxDeck, Expression, LoadCurve, Vector};

pub use tool_shape::ToolShape;

/// A rigid tool that touches the bodies: it moves as prescribed, or as equilibrium with its loads and the bodies
/// requires, and no body may penetrate it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolDeck {
    /// Name, unique among the tools; its forces are reported under this name.
    pub name: String,
    /// Shape, in its position at the start.
    pub shape: ToolShape,
    /// Point of the tool to which its displacement and moment refer and about which it rotates, [length]; by default
    /// the centre of the box around the shape, or the point of a half-space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vector>", extend("examples" = [[0, 4]]))]
    pub reference: Option<Vec<f64>>,
    /// Rotation of the shape about the reference point before the start, [degree]: the angle in the plane,
    /// counter-clockwise, or the rotation vector in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [30, [0, 0, 30]]))]
    pub turned: Option<Turn>,
    /// Displacement of the reference point along x at load factor 1, [length]: a number, or a formula in `factor` (the
    /// load factor), `time` and the parameters. A formula that contains `factor` or `time` states the whole
    /// displacement; any other formula is multiplied by the load factor. 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0.1, "0.1 * sin(2 * pi * time)"]))]
    pub ux: Option<Expression>,
    /// Displacement along y: a number or a formula, as for `ux`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [-0.5]))]
    pub uy: Option<Expression>,
    /// Displacement along z: a number or a formula, as for `ux`; in space only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [-0.5]))]
    pub uz: Option<Expression>,
    /// Rotation about the reference point at load factor 1, [degree]: in the plane, one number or formula, as for `ux`,
    /// counter-clockwise; in space, a list of the three components of the rotation vector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [90, [0, 0, "360 * time"]]))]
    pub rotation: Option<RotationDeck>,
    /// Load factor of the prescribed motion over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
    /// Components of the motion that follow from equilibrium between the loads of the tool and the bodies: the
    /// displacements `x`, `y`, `z`, the `rotation` in the plane, and the rotations `rx`, `ry`, `rz` in space.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("examples" = [["y"]]))]
    pub free: Vec<FreeDeck>,
    /// Weight of the tool at load factor 1, [force] (per unit thickness in plane strain, of the full circle in
    /// axisymmetry); it acts at the reference point, downwards along the last axis. The displacement along this axis
    /// must be free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [50e3]))]
    pub weight: Option<f64>,
    /// Load factor of the weight over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight_curve: Option<LoadCurve>,
    /// Further loads on the tool, which move its free components.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<ToolLoadDeck>,
    /// Coefficient of friction, [-], or `rough`: the surfaces stick as long as they touch. 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0.3, "rough"]))]
    pub friction: Option<FrictionDeck>,
    /// Shear strength that does not depend on the pressure, [stress]; 0 by default. The shear stress is at most (1 +
    /// `friction`) times the sum of the pressure and the tension cut-off, or ten times this sum on rough surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
    pub adhesion: Option<f64>,
    /// Largest tension of the interface, [stress]; 0 by default. It acts once the surfaces have touched, until they
    /// separate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [1e3]))]
    pub tension_cut_off: Option<f64>,
    /// Names of the bodies that the tool touches; all bodies by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [["clay"]]))]
    pub bodies: Option<Vec<String>>,
    /// Interfaces with individual bodies, if they differ from the interface that the tool states.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactDeck>,
    /// Named parts of the surface of the tool, such as the tip and the shaft of a pile. The force and the moment on
    /// each part are columns of `history.csv`. Parts may overlap.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("examples" = [{"tip": {"edges": [0, 1]}}]))]
    pub parts: BTreeMap<String, ToolPartDeck>,
    /// Penalty stiffness of the contact per unit area, as a multiple of 4G/h, with the shear modulus G of the body and
    /// the cell size h, [-]; results do not depend on it. With small values, fewer iterations are needed where bodies
    /// flow plastically.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6), extend("examples" = [10]))]
    pub penalty: Option<f64>,
    /// Largest mean overlap of a body and the tool around a node that a converged step may have, relative to the cell
    /// size, [-]; by default 1e-6. Where more corners touch than the nodes have degrees of freedom, 1e-4 is accepted
    /// instead, and 1e-3 after many multiplier updates. The overlap of a single corner may always reach 1e-3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-12, max = 0.1), extend("examples" = [1e-6]))]
    pub overlap: Option<f64>,
}

/// A rotation, [degree]: an angle in the plane, a rotation vector in space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Turn {
    /// The angle in the plane, counter-clockwise.
    Angle(f64),
    /// The rotation vector in space.
    Vector(#[schemars(length(min = 3, max = 3))] Vec<f64>),
}

/// A prescribed rotation, [degree].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RotationDeck {
    /// The angle in the plane, counter-clockwise.
    Angle(f64),
    /// A formula of the angle in the plane.
    Formula(String),
    /// The components of the rotation vector in space.
    Vector(#[schemars(length(min = 3, max = 3))] Vec<Expression>),
}

/// A component of the motion of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FreeDeck {
    /// The displacement along x.
    X,
    /// The displacement along y.
    Y,
    /// The displacement along z.
    Z,
    /// The rotation in the plane.
    Rotation,
    /// The rotation about x.
    Rx,
    /// The rotation about y.
    Ry,
    /// The rotation about z.
    Rz,
}

/// A load on a tool, with a fixed direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolLoadDeck {
    /// Force at the reference point at load factor 1, [force] (per unit thickness in plane strain, on the full circle
    /// in axisymmetry), one number per axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vector>", extend("examples" = [[0, -20e3]]))]
    pub force: Option<Vec<f64>>,
    /// Moment about the reference point at load factor 1, [force·length]: one number in the plane, counter-clockwise,
    /// or a vector in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [5e3]))]
    pub moment: Option<Turn>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

/// A part of the surface of a tool: the portion that lies on the sides `edges` and inside the box `box`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ToolPartDeck {
    /// Numbers of sides of the shape, from 0; all sides by default. Polygon, polyline (both faces) or section of a body
    /// of revolution: side i runs from corner i to the next. Box in the plane: bottom, right, top, left. Box in space:
    /// lowest x, highest x, lowest y, and so on. Cylinder or cone: lateral surface (0), start (1), end (2). Extruded
    /// polygon: its sides, then its lower and upper ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1), extend("examples" = [[0, 1]]))]
    pub edges: Option<Vec<u32>>,
    /// Box in which the part lies, its boundary included, in coordinates at the start of the analysis; it moves with
    /// the tool.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub within: Option<BoxDeck>,
}

/// The resistance of an interface to sliding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FrictionDeck {
    /// Coefficient of friction, [-].
    Coefficient(#[schemars(extend("minimum" = 0.0))] f64),
    /// The surfaces stick as long as they touch.
    Sticking(Sticking),
}

/// Surfaces that stick as long as they touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Sticking {
    /// They do not slide.
    Rough,
}

/// The interface of a tool with one body; keys that are left out take the values of the tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactDeck {
    /// Name of the body.
    pub body: String,
    /// Coefficient of friction, [-], or `rough`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0.3, "rough"]))]
    pub friction: Option<FrictionDeck>,
    /// Shear strength that does not depend on the pressure, [stress].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
    pub adhesion: Option<f64>,
    /// Largest tension of the interface, [stress].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [1e3]))]
    pub tension_cut_off: Option<f64>,
}

impl ToolDeck {
    /// True if the tool moves as prescribed or bears a load.
    pub(crate) fn acts(&self) -> bool {
        self.weight.is_some()
            || !self.loads.is_empty()
            || self.motion().iter().any(|(_, _, value)| !value.is_zero())
    }

    /// True if the tool is free along an axis, or if a non-zero motion along this axis is prescribed.
    pub(crate) fn may_move_along(&self, axis: usize) -> bool {
        let is_along = |component: FreeDeck| component as usize == axis;
        let mut motion = self.motion().into_iter();
        self.free.iter().any(|component| is_along(*component))
            || motion.any(|(_, component, value)| is_along(component) && !value.is_zero())
    }

    /// The load curves of the motion, the weight and the further loads, each with its key.
    pub fn curves(&self) -> impl Iterator<Item = (String, &LoadCurve)> {
        let loads = self.loads.iter().enumerate();
        let load_curves =
            loads.filter_map(|(k, load)| Some((format!("loads/{k}/curve"), load.curve.as_ref()?)));
        let named = [("curve", &self.curve), ("weight_curve", &self.weight_curve)];
        let named = named.into_iter().filter_map(|(key, curve)| Some((key.to_owned(), curve.as_ref()?)));
        named.chain(load_curves)
    }

    /// The prescribed components of the motion, each with its key: the displacements, then the rotations.
    pub(crate) fn motion(&self) -> Vec<(String, FreeDeck, Expression)> {
        use FreeDeck::{Rotation, Rx, Ry, Rz, X, Y, Z};
        let along = [("ux", X, &self.ux), ("uy", Y, &self.uy), ("uz", Z, &self.uz)];
        let along = along.into_iter().filter_map(|(key, component, value)| {
            value.clone().map(|value| (key.to_owned(), component, value))
        });
        let turning: Vec<_> = match &self.rotation {
            None => Vec::new(),
            Some(RotationDeck::Angle(angle)) => {
                vec![("rotation".to_owned(), Rotation, Expression::Number(*angle))]
            }
            Some(RotationDeck::Formula(text)) => {
                vec![("rotation".to_owned(), Rotation, Expression::Formula(text.clone()))]
            }
            Some(RotationDeck::Vector(vector)) => {
                let each = vector.iter().zip([Rx, Ry, Rz]).enumerate();
                each.map(|(k, (value, component))| (format!("rotation/{k}"), component, value.clone()))
                    .collect()
            }
        };
        along.chain(turning).collect()
    }
}

impl FreeDeck {
    /// True if the component is a rotation.
    pub(crate) fn is_rotation(self) -> bool {
        !matches!(self, FreeDeck::X | FreeDeck::Y | FreeDeck::Z)
    }

    /// Name of the component in decks.
    pub(crate) fn word(self) -> &'static str {
        ["x", "y", "z", "rotation", "rx", "ry", "rz"][self as usize]
    }

    /// True if the component exists in this number of dimensions.
    pub(crate) fn exists(self, dimensions: usize) -> bool {
        match self {
            FreeDeck::X | FreeDeck::Y => true,
            FreeDeck::Rotation => dimensions == 2,
            FreeDeck::Z | FreeDeck::Rx | FreeDeck::Ry | FreeDeck::Rz => dimensions == 3,
        }
    }
}
