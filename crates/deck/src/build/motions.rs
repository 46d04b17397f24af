//! Motions of the ground from files.

use super::Builder;
use crate::region::DeckRegion;
use crate::{LoadDeck, MotionDeck};
use mpm_core::model::{Absorbed, LoadCurve};
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The boundaries that a stage lets absorb waves.
    pub(super) fn absorbed(&mut self, stage: usize) -> Vec<Absorbed<D>> {
        let deck = self.deck;
        let mut all = Vec::new();
        for (number, absorb) in deck.stages[stage].absorb.iter().enumerate() {
            let pointer = format!("/stages/{stage}/absorb/{number}/motion");
            let mut named = deck.boundary_conditions.iter();
            let condition = named.position(|condition| condition.name == absorb.condition).unwrap_or(0);
            let incoming = absorb.motion.as_ref().and_then(|motion| {
                let axis = motion.axis as usize;
                let pairs = self.pairs(motion, &pointer)?;
                // Half of the motion of a free surface comes up as a wave.
                let mut table = motion.velocity(&pairs, deck.motion_begins());
                table.iter_mut().for_each(|pair| pair[1] *= 0.5);
                let direction = std::array::from_fn(|d| if d == axis { 1.0 } else { 0.0 });
                Some((direction, LoadCurve::table(table)))
            });
            all.push(Absorbed { condition, incoming });
        }
        all
    }

    /// The factor over time of a motion of a rigid base, which acts as a force per mass in its frame; `None` for other
    /// loads.
    pub(super) fn base_motion(&mut self, load: &LoadDeck, pointer: &str) -> Option<LoadCurve> {
        let LoadDeck::BaseMotion(base) = load else { return None };
        let pairs = self.pairs(&base.motion, &format!("{pointer}/motion"))?;
        Some(LoadCurve::table(base.motion.acceleration(&pairs, self.deck.motion_begins())))
    }

    /// The pairs of time and quantity in the file of a motion.
    fn pairs(&mut self, motion: &MotionDeck, pointer: &str) -> Option<Vec<[f64; 2]>> {
        let path = self.loaded.directory.join(&motion.file);
        let help = "give a file of two columns: the time, and the acceleration or velocity at that time";
        let pairs = match std::fs::read_to_string(&path) {
            Ok(text) => motion
                .pairs(&text)
                .map_err(|(line, fault)| format!("`{}`, line {line}: {fault}", motion.file)),
            Err(error) => Err(format!("`{}` cannot be read: {error}", motion.file)),
        };
        pairs.map_err(|message| self.error("D082", &format!("{pointer}/file"), message, help.to_owned())).ok()
    }
}
