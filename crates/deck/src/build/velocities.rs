//! The velocities with which bodies begin to move.

use std::collections::BTreeMap;

use super::Builder;
use crate::formulas::at_places;
use crate::quoting::quote;
use crate::region::DeckRegion;
use mpm_core::model::VectorFormula;
use mpm_core::points::Points;
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Gives the points of all bodies their velocities at the start.
    pub(super) fn velocities(&mut self, points: &mut Points<D>) {
        let deck = self.deck;
        let mut formulas: Vec<Option<VectorFormula<D>>> = Vec::new();
        for (number, body) in deck.bodies.iter().enumerate() {
            let Some(velocity) = &body.velocity else {
                formulas.push(None);
                continue;
            };
            match at_places::<D, D>("velocity", velocity, &BTreeMap::new(), &deck.parameters) {
                Ok(formula) => formulas.push(Some(formula)),
                Err(faults) => {
                    formulas.push(None);
                    self.faulty_formulas(&format!("/bodies/{number}"), faults);
                }
            }
        }
        let at = |p: usize| {
            let place = &points.converged.position[p];
            formulas[usize::from(points.body[p])].as_ref().map(|formula| formula.evaluate(place, place, 1.0))
        };
        let velocities: Vec<[f64; D]> = (0..points.len()).map(|p| at(p).unwrap_or([0.0; D])).collect();
        if let Some(p) = velocities.iter().position(|v| v.iter().any(|v| !v.is_finite())) {
            let number = usize::from(points.body[p]);
            let message = format!(
                "the velocity of the body {} is not finite at {}",
                quote(&deck.bodies[number].name),
                mpm_core::points::coordinates(&points.converged.position[p])
            );
            let help = "change the formula so that it has a value at all points of the body".to_owned();
            return self.error("D021", &format!("/bodies/{number}/velocity"), message, help);
        }
        points.set_velocity(|p| velocities[p]);
    }
}
