//! Point arrays whose meaning depends on the laws of the model.

use super::Model;
use crate::points::{PointArray, PointValues, Points};

/// The index of a history variable among the history variables of each law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HistoryVariable {
    /// Index for each body; `None` if its law does not have the variable.
    place: Vec<Option<usize>>,
}

impl HistoryVariable {
    /// The history variable with this name.
    pub fn new<const D: usize>(model: &Model<D>, name: &str) -> HistoryVariable {
        let law = |material: usize| &model.materials[material].law;
        let place = |material| law(material).state_fields().iter().position(|field| field.name == name);
        HistoryVariable { place: model.bodies.iter().map(|body| place(body.material)).collect() }
    }

    /// The value of the variable at a point in the converged state; zero if the law does not have it.
    pub fn value<const D: usize>(&self, points: &Points<D>, p: usize) -> f64 {
        match self.place[points.body[p] as usize] {
            Some(k) => points.converged.history[p * points.history_len + k],
            None => 0.0,
        }
    }
}

impl<const D: usize> Model<D> {
    /// The names of the history variables of the laws that bodies have now or get in a stage, each once.
    pub fn history_names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        let now = self.bodies.iter().map(|body| body.material);
        let later =
            self.stages.iter().flat_map(|stage| stage.materials.iter().map(|(_, material)| *material));
        for field in now.chain(later).flat_map(|material| self.materials[material].law.state_fields()) {
            if !names.contains(&&*field.name) {
                names.push(&*field.name);
            }
        }
        names
    }

    /// The point array with this name, in the converged state. Names have the same meaning as in VTU files: the arrays
    /// of [`PointArray`], but with the logarithmic elastic strain and the volume of [`Model::volume`]; history
    /// variables of laws, zero for points of other laws; declared fields ([`Points::STORED`]); and further fields
    /// ([`Points::declare`]). `None` if nothing has this name.
    ///
    /// One row per point in the order of the permanent numbers; [`PointArray`] defines the order of components and the
    /// units.
    pub fn array(&self, points: &Points<D>, name: &str) -> Option<PointValues> {
        let order = points.by_id();
        let logarithmic =
            |p: usize| self.law(points, p).strain_measure().logarithmic(&points.converged.elastic_strain[p]);
        match PointArray::named(name) {
            Some(PointArray::ElasticStrain) => return Some(PointValues::new(&order, logarithmic)),
            Some(PointArray::Volume) => {
                return Some(PointValues::new(&order, |p| self.volume(points, p)));
            }
            Some(array) => return Some(points.array(array)),
            None => (),
        }
        if self.history_names().contains(&name) {
            let history = HistoryVariable::new(self, name);
            return Some(PointValues::new(&order, |p| history.value(points, p)));
        }
        points.field(name)
    }
}
