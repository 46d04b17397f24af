//! What terms report of a step.

use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// A force on the bodies, and the name under which it is reported.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedForce<const D: usize> {
    /// Name of the force.
    pub name: String,
    /// Force, [force].
    pub force: [f64; D],
}

/// The reaction that a boundary condition of the model, imposed on a surface, exerts on the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceReaction<const D: usize> {
    /// Number of the condition.
    pub condition: usize,
    /// Force, [force].
    pub force: [f64; D],
    /// The mean position of the surface at the end of the step, [length].
    pub about: [f64; D],
    /// Moment of the force about this position and the axes x, y and z, [force·length].
    pub moment: [f64; 3],
}

/// What prescribed motions do in a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Driven {
    /// Force that holds the bodies on each prescribed path, times the motion along the path in the step, summed over all
    /// of them, [energy]: work at the forces at the end of the step.
    pub work: f64,
    /// The largest prescribed displacement in the step, [length], or [rad] where bodies are only turned.
    pub displacement: f64,
}

impl Driven {
    /// Adds another motion.
    pub fn add(&mut self, other: Driven) {
        self.work += other.work;
        self.displacement = self.displacement.max(other.displacement);
    }

    /// The force along the largest prescribed displacement, [force]; `None` if nothing is moved.
    pub fn force(&self) -> Option<f64> {
        (self.displacement > 0.0).then(|| self.work / self.displacement)
    }
}

/// What the terms report of a step.
#[derive(Debug, Clone, Default)]
pub struct TermReport<const D: usize> {
    /// Resultants of the loads of the model, in their order, of the points of this rank, [force].
    pub(crate) loads: Vec<[f64; D]>,
    /// Further forces on the bodies.
    pub(crate) forces: Vec<NamedForce<D>>,
    /// Reactions, on all ranks, of the boundary conditions of the model that are imposed on surfaces.
    pub(crate) reactions: Vec<SurfaceReaction<D>>,
    /// Number of faces between cells that are stabilised on this rank.
    pub(crate) stabilised_faces: usize,
    /// What the prescribed motions do that terms impose, on all ranks.
    pub(crate) driven: Driven,
    /// What terms report by types of their own.
    pub(crate) records: Records,
}

impl<const D: usize> TermReport<D> {
    /// Resultants of the loads of the model, in their order, of the points of this rank, [force].
    pub fn loads(&self) -> &[[f64; D]] {
        &self.loads
    }

    /// Further forces on the bodies, on this rank.
    pub fn forces(&self) -> &[NamedForce<D>] {
        &self.forces
    }

    /// What terms report by types of their own.
    pub fn records(&self) -> &Records {
        &self.records
    }

    /// Adds to the resultant of a load of the model what the term applies on this rank, [force]; a number that no load
    /// has is ignored.
    pub fn add_to_load(&mut self, load: usize, force: [f64; D]) {
        if let Some(sum) = self.loads.get_mut(load) {
            (0..D).for_each(|d| sum[d] += force[d]);
        }
    }

    /// Adds a further force on the bodies, reported under this name; for example, the force from a wall. A term states
    /// the force on this rank, [force], and the same names in the same order on all ranks. Forces of the same name are
    /// added up.
    pub fn add_force(&mut self, name: &str, force: [f64; D]) {
        match self.forces.iter_mut().find(|named| named.name == name) {
            Some(named) => (0..D).for_each(|d| named.force[d] += force[d]),
            None => self.forces.push(NamedForce { name: name.to_owned(), force }),
        }
    }

    /// Adds what a prescribed motion that the term imposes does in the step, on all ranks.
    pub fn add_driven(&mut self, driven: Driven) {
        self.driven.add(driven);
    }

    /// Reports a list of values of a type that belongs to the term; [`Records::list`] finds it by this type. The values
    /// are those of all ranks, and only one term may report values of a type.
    pub fn add_list<T: Record>(&mut self, values: Vec<T>) {
        self.records.0.push(Arc::new(values));
    }
}

/// A value that a term may report.
pub trait Record: Any + fmt::Debug + Send + Sync {}

impl<T: Any + fmt::Debug + Send + Sync> Record for T {}

/// What terms report of a step, each by types of its own: neither the solver nor the report of a step knows them.
#[derive(Debug, Clone, Default)]
pub struct Records(Vec<Arc<dyn Record>>);

impl Records {
    /// The values of this type that a term has reported; none if no term reports any.
    pub fn list<T: Record>(&self) -> &[T] {
        let mut lists = self.0.iter().filter_map(|record| {
            let any: &dyn Any = record.as_ref();
            any.downcast_ref::<Vec<T>>()
        });
        lists.next().map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reported_forces_add_up() {
        let mut report = TermReport::<2> { loads: vec![[1.0, 2.0]], ..TermReport::default() };
        report.add_to_load(0, [0.5, -2.0]);
        report.add_to_load(1, [9.0; 2]);
        assert_eq!(report.loads(), [[1.5, 0.0]]);
        report.add_force("wall", [1.0, 0.0]);
        report.add_force("anchor", [0.0, 1.0]);
        report.add_force("wall", [1.0, 3.0]);
        let found: Vec<_> = report.forces().iter().map(|named| (named.name.as_str(), named.force)).collect();
        assert_eq!(found, [("wall", [2.0, 3.0]), ("anchor", [0.0, 1.0])]);
    }

    #[test]
    fn values_are_found_by_their_type() {
        #[derive(Debug, PartialEq)]
        struct Flux(f64);
        let mut report = TermReport::<2>::default();
        assert!(report.records().list::<Flux>().is_empty());
        report.add_list(vec!["sensor".to_owned()]);
        report.add_list(vec![Flux(1.0), Flux(2.0)]);
        assert_eq!(report.clone().records().list::<Flux>(), [Flux(1.0), Flux(2.0)]);
        assert_eq!(report.records().list::<String>(), ["sensor"]);
        assert!(report.records().list::<f64>().is_empty());
    }
}
