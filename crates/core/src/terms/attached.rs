//! Terms that are attached to places on the bodies, and terms that are obstacles in their way.

use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::{Points, Split};

use super::failure::BeginError;

/// A term attached to places on the bodies, such as their surfaces.
pub trait Attached<const D: usize> {
    /// Grid nodes that the term needs on this rank in addition to the nodes of `links`. Called before a step begins,
    /// only if there are several ranks, and then on all ranks.
    ///
    /// # Errors
    /// [`BeginError`] if the term cannot begin the step.
    fn reach(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _links: &Connectivity<D>,
    ) -> Result<Vec<u32>, BeginError> {
        Ok(Vec::new())
    }

    /// Discards what the term keeps from earlier steps about bodies that a stage removes: if they are added again, in
    /// this stage or later, they begin anew. Called between two stages, once the state has been restored.
    fn forget_bodies(&mut self, model: &Model<D>, removed: &[usize]);

    /// Moves what the term keeps about the body with this index, which a stage adds at another place than where it was
    /// drawn; `moved` gives the position at which a place is added. Called between two stages, once the state has been
    /// restored.
    fn place_body(
        &mut self,
        _model: &Model<D>,
        _body: usize,
        _moved: &dyn Fn(&[f64; D]) -> Option<[f64; D]>,
    ) {
    }

    /// Adapts what the term keeps about places on the domains of points that have just been cut, each once, after the
    /// step that has ended at `time`; the step has been committed. All ranks call this together.
    fn follow_cuts(&mut self, _model: &Model<D>, _points: &Points<D>, _cuts: &[Split], _time: f64) {}
}

/// A term that keeps the bodies out of a part of space.
pub trait Obstacle<const D: usize> {
    /// The position nearest to `place`, [length], that the body can occupy at the last commit: outside all obstacles.
    fn nearest_allowed(&self, model: &Model<D>, body: usize, place: [f64; D]) -> [f64; D];
}
