//! The initial moduli of material points, which serve as scales of stiffness.

use super::Model;
use crate::material::Modulus;
use crate::points::Points;
use crate::tensor::padded;

/// An initial modulus of every material point. The points of a material differ only if its properties vary in space.
pub struct ModuliAtRest<'a, const D: usize> {
    model: &'a Model<D>,
    modulus: Modulus,
    /// For each material, its initial history variables with typical properties, and the modulus for these.
    typical: Vec<(Vec<f64>, f64)>,
}

impl<'a, const D: usize> ModuliAtRest<'a, D> {
    /// This modulus of the points of a model.
    pub fn new(model: &'a Model<D>, modulus: Modulus) -> Self {
        let typical = model.materials.iter().map(|material| {
            let history = material.law.initial_history();
            let value = modulus.at_rest(material.law.as_ref(), &history);
            (history, value)
        });
        ModuliAtRest { model, modulus, typical: typical.collect() }
    }

    /// The modulus of a point, [stress].
    pub fn at(&self, points: &Points<D>, p: usize) -> f64 {
        let material = self.model.bodies[points.body[p] as usize].material;
        let law = self.model.materials[material].law.as_ref();
        let history = law.initial_history_at(&padded(&points.original_position[p]));
        match &self.typical[material] {
            (typical, value) if *typical == history => *value,
            _ => self.modulus.at_rest(law, &history),
        }
    }
}
