//! The services that the semantic checks and the model builder provide to each kind of load and boundary condition, so
//! that each kind can check and build itself.

use std::collections::BTreeMap;

use super::formulas::{Displacement, Fault};
use super::{Expression, Parameter};

/// Semantic checks of a deck. Each reports what it finds at the location in the deck that `pointer` names.
pub(crate) trait Checks {
    /// Number of axes.
    fn dimensions(&self) -> usize;
    /// Reports an error.
    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: &str);
    /// Reports an error at the key rather than at its value.
    fn error_at_key(&mut self, code: &'static str, pointer: &str, message: String, help: &str);
    /// Reports something that exists only in this number of dimensions.
    fn wrong_dimension(&mut self, pointer: &str, what: &str, dimensions: usize);
    /// The components of a vector, if there is one for each axis.
    fn vector(&mut self, pointer: &str, components: &[f64]) -> Option<Vec<f64>>;
    /// Reports a vector with too few or too many components.
    fn wrong_count(&mut self, pointer: &str, found: usize);
    /// Checks that a body of this name exists.
    fn body(&mut self, pointer: &str, name: &str);
    /// Checks that the bodies on which a load acts exist, each listed once.
    fn targets(&mut self, pointer: &str, bodies: Option<&[String]>);
    /// Checks that the bodies on which a load per mass acts have a density.
    fn weight(&mut self, pointer: &str, load: &str, bodies: Option<&[String]>);
    /// Checks that a surface of this name exists.
    fn surface(&mut self, pointer: &str, name: &str);
    /// Checks the formulas of a load on a surface under this key: one for each axis, or a single one if `is_scalar`.
    fn formulas_at_places(
        &mut self,
        pointer: &str,
        key: &str,
        components: &[Expression],
        is_scalar: bool,
        intermediate: &BTreeMap<String, Expression>,
    );
    /// Checks the formulas of a load at points.
    fn formulas_at_points(
        &mut self,
        pointer: &str,
        force: &[Expression],
        intermediate: &BTreeMap<String, Expression>,
    );
    /// Checks the formulas of a boundary condition at nodes.
    fn formulas_at_nodes(
        &mut self,
        pointer: &str,
        displacements: Vec<Displacement>,
        intermediate: &BTreeMap<String, Expression>,
    );
}

/// Treatment of equally near points of which only some are requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ties {
    /// An error, since round-off would choose between them.
    Refused,
    /// All of these points are taken.
    All,
}

/// The points of a body nearest to a location, as a load or a probe asks for them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearestPoints<'a> {
    /// The location, [length].
    pub place: &'a [f64],
    /// Number of points.
    pub count: u32,
    /// Treatment of points that are equally near.
    pub ties: Ties,
}

/// The builder of a model. It reports what it finds at the location in the deck that `pointer` names.
pub(crate) trait Builds {
    /// The parameters of the deck.
    fn parameters(&self) -> &BTreeMap<String, Parameter>;
    /// Reports faults of formulas.
    fn faulty_formulas(&mut self, pointer: &str, faults: Vec<Fault>);
    /// Index of a surface.
    fn surface_number(&self, name: &str) -> usize;
    /// Permanent numbers of the points of a body nearest to a location.
    fn nearest(&mut self, body: &str, wanted: NearestPoints, pointer: &str) -> Vec<u32>;
}
