//! The kinds of failures.

use serde::{Deserialize, Serialize};

/// The kind of a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A part of the bodies can move or turn freely.
    RigidBodyMode,
    /// Nothing resists the motion of a rigid tool, or of another moving part, in its free components.
    FreeTool,
    /// A cell holds hardly any material.
    SmallCutCell,
    /// The bodies slide on tools, whose friction and adhesion are used up.
    Sliding,
    /// The load is beyond what the bodies can carry.
    PlasticCollapse,
    /// The iterations do not follow the plastic flow of the material.
    Flow,
    /// Contact points change between sticking and sliding without end.
    Friction,
    /// Contact points open and close without end.
    Contact,
    /// The bodies buckle or snap through without yielding.
    Instability,
    /// The grid cannot represent volume-preserving deformation.
    Locking,
    /// Neighbouring nodes move in opposite directions without resistance from the points.
    Hourglass,
    /// Residuals fall steadily, and more iterations would meet the tolerance.
    Creeping,
    /// Steps are too large, relative to the stage or to the time reached in it, for a conclusion about the load.
    LargeSteps,
    /// The deformation gradient of a point loses its positive determinant.
    ElementInversion,
    /// A law refuses the strain of a point.
    RefusedByLaw,
    /// A point or its domain leaves the grid, or the domain loses its shape.
    LostDomain,
    /// The equilibrium path cannot be followed.
    LostPath,
    /// Stiffnesses are so far apart, or so far above the loads, that round-off hides the forces.
    BadScaling,
    /// An obstacle that no step size removes.
    Setting,
    /// None of these; perhaps loads and boundary conditions contradict each other.
    Unknown,
}

impl Kind {
    /// True if the kind explains why iterations do not converge.
    pub(super) fn is_about_iterations(self) -> bool {
        matches!(
            self,
            Kind::PlasticCollapse | Kind::Instability | Kind::LargeSteps | Kind::Creeping | Kind::Unknown
        )
    }

    /// The kind as text.
    pub fn words(self) -> &'static str {
        match self {
            Kind::RigidBodyMode => "a rigid-body mode is free",
            Kind::FreeTool => "the bodies do not resist the motion of a tool in its free components",
            Kind::SmallCutCell => "a cell that holds hardly any material",
            Kind::Sliding => {
                "sliding: only contact holds the bodies, and its friction and adhesion are used up"
            }
            Kind::PlasticCollapse => {
                "plastic collapse: the load is probably beyond what the bodies can carry"
            }
            Kind::Flow => "plastic flow that the iterations do not follow",
            Kind::Friction => "friction: contact points change between sticking and sliding without end",
            Kind::Contact => "contact: contact points open and close without end",
            Kind::Instability => {
                "instability: the stiffness is not positive definite, though hardly any point has yielded"
            }
            Kind::Locking => "volumetric locking: pressures alternate while volumes hardly change",
            Kind::Hourglass => {
                "hourglass mode: neighbouring nodes move in opposite directions, which too few points resist"
            }
            Kind::Creeping => "the residual falls steadily, but the iterations end too soon",
            Kind::LargeSteps => "the steps are too large",
            Kind::ElementInversion => "a point turns inside out",
            Kind::RefusedByLaw => "the law of a point rejects its strain",
            Kind::LostDomain => "a point or its domain leaves the grid or loses its shape",
            Kind::LostPath => "the path cannot be followed",
            Kind::BadScaling => "a badly scaled stiffness: its round-off is larger than the forces",
            Kind::Setting => "an obstacle that no step size removes",
            Kind::Unknown => "none of the known causes was found",
        }
    }
}
