//! The energies of the terms of equilibrium, by name.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::ranks::Ranks;

/// The role of an energy in the balance: the energy supplied is stored or dissipated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Energy that can be recovered.
    Stored,
    /// Energy that is lost.
    Dissipated,
    /// Work on the bodies in addition to that of external forces and reactions.
    Supplied,
}

/// The time over which an amount of energy has accrued.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Amount {
    /// The energy of one step or, in a sum, of all steps so far, [energy].
    Accrued(f64),
    /// An energy that follows from the state, [energy]: at the end of the step, and at the start from which the balance
    /// counts. A run counts from the start of the first step in which the energy occurs.
    State {
        /// At the end of the step.
        now: f64,
        /// At the start.
        start: f64,
    },
}

impl Amount {
    /// The energy that counts in the balance, [energy].
    pub fn growth(self) -> f64 {
        match self {
            Amount::Accrued(energy) => energy,
            Amount::State { now, start } => now - start,
        }
    }

    /// The energy at the end of the step or, if it does not follow from the state, the energy so far, [energy].
    pub fn value(self) -> f64 {
        match self {
            Amount::Accrued(energy) => energy,
            Amount::State { now, .. } => now,
        }
    }
}

/// An energy with its name and its role.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedEnergy {
    /// Name of the energy.
    pub name: Cow<'static, str>,
    /// Role in the balance.
    pub role: Role,
    /// Amount.
    pub amount: Amount,
}

impl NamedEnergy {
    /// An energy stored in the state, at the start and at the end of a step, [energy].
    pub fn stored(name: impl Into<Cow<'static, str>>, [start, now]: [f64; 2]) -> Self {
        NamedEnergy { name: name.into(), role: Role::Stored, amount: Amount::State { now, start } }
    }

    /// An energy dissipated in a step, [energy].
    pub fn dissipated(name: impl Into<Cow<'static, str>>, in_step: f64) -> Self {
        NamedEnergy { name: name.into(), role: Role::Dissipated, amount: Amount::Accrued(in_step) }
    }

    /// An energy dissipated since the start of the analysis, which follows from the state, [energy].
    pub fn dissipated_so_far(name: impl Into<Cow<'static, str>>, now: f64) -> Self {
        NamedEnergy { name: name.into(), role: Role::Dissipated, amount: Amount::State { now, start: 0.0 } }
    }

    /// Work supplied in a step, [energy].
    pub fn supplied(name: impl Into<Cow<'static, str>>, in_step: f64) -> Self {
        NamedEnergy { name: name.into(), role: Role::Supplied, amount: Amount::Accrued(in_step) }
    }

    /// What the energy adds to the work that the balance has to explain, [energy]: positive if it was supplied, negative
    /// if it was stored or dissipated.
    pub fn unexplained(&self) -> f64 {
        match self.role {
            Role::Supplied => self.amount.growth(),
            Role::Stored | Role::Dissipated => -self.amount.growth(),
        }
    }

    /// True if this is the same energy, though its amount may differ.
    pub(crate) fn is_same(&self, other: &NamedEnergy) -> bool {
        let kinds = [self.amount, other.amount].map(|amount| matches!(amount, Amount::State { .. }));
        self.name == other.name && self.role == other.role && kinds[0] == kinds[1]
    }
}

/// The energies of a term, or of all terms, in a step. The following names belong to the library; terms may add to them.
/// Energies of any other name are reported under it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ledger(Vec<NamedEnergy>);

impl Ledger {
    /// The stored elastic energy.
    pub const ELASTIC: &'static str = "elastic";
    /// The plastic work, as the history variables of the laws record it at full strength.
    pub const PLASTIC: &'static str = "plastic";
    /// Plastic work of the step that the history variables record but that was not done, because the strength was
    /// reduced: it is supplied.
    pub const UNDONE: &'static str = "undone plastic work";
    /// Work of the ghost stabilisation during the step, which is lost in the next one.
    pub const STABILISATION: &'static str = "stabilisation";
    /// What the overstress of a step with viscosity dissipates.
    pub const VISCOUS: &'static str = "viscous";
    /// Energy of the stresses that resist the deviations of points from the mean increment of their cell.
    pub const DEVIATION: &'static str = "deviation from cell means";
    /// Work of the mean stresses of a step with inertia that is neither stored nor dissipated by the law: the error of
    /// the integration in time where points yield or share the strain of their cell.
    pub const DEFECT: &'static str = "defect";
    /// What a scheme of time integration dissipates on purpose.
    pub const ALGORITHMIC: &'static str = "algorithmic";
    /// Kinetic energy of the points.
    pub const KINETIC: &'static str = "kinetic";
    /// Kinetic energy of the velocities that ghost mass takes away.
    pub const GHOST: &'static str = "ghost mass";
    /// Kinetic energy that the points lose where the velocity of the grid replaces theirs.
    pub const PIC: &'static str = "PIC";
    /// What Rayleigh damping dissipates.
    pub const RAYLEIGH: &'static str = "Rayleigh damping";
    /// What absorbing boundaries swallow.
    pub const ABSORBED: &'static str = "absorbed";
    /// Kinetic energy that is lost where a static stage follows motion.
    pub const STOPPED: &'static str = "brought to rest";
    /// Energy dissipated by friction between tools and bodies: work of the tools that does not reach the bodies. The
    /// external work contains it.
    pub const FRICTION: &'static str = "friction";

    /// Adds an energy; amounts of the same name and role add up.
    pub fn add(&mut self, energy: NamedEnergy) {
        let Some(sum) = self.0.iter_mut().find(|sum| sum.is_same(&energy)) else {
            // A negative zero becomes zero, as in any other sum.
            let amount = match energy.amount {
                Amount::Accrued(of) => Amount::Accrued(0.0 + of),
                Amount::State { now, start } => Amount::State { now: 0.0 + now, start: 0.0 + start },
            };
            self.0.push(NamedEnergy { amount, ..energy });
            return;
        };
        match (&mut sum.amount, energy.amount) {
            (Amount::Accrued(sum), Amount::Accrued(more)) => *sum += more,
            (Amount::State { now, start }, Amount::State { now: more, start: before }) => {
                *now += more;
                *start += before;
            }
            _ => {}
        }
    }

    /// The energies in the order in which they were added.
    pub fn iter(&self) -> impl Iterator<Item = &NamedEnergy> {
        self.0.iter()
    }

    /// The energy of a name, [energy]: at the end of the step if it follows from the state, otherwise of the step.
    pub fn energy(&self, name: &str) -> f64 {
        self.0
            .iter()
            .filter(|energy| energy.name == name)
            .map(|energy| energy.amount.value())
            .fold(0.0, |a, b| a + b)
    }

    /// The energies that have none of the names above.
    pub fn further(&self) -> Vec<NamedEnergy> {
        let known = [Self::ELASTIC, Self::PLASTIC, Self::UNDONE, Self::STABILISATION, Self::FRICTION];
        self.0.iter().filter(|energy| !known.contains(&energy.name.as_ref())).cloned().collect()
    }
}

impl<const K: usize> From<[NamedEnergy; K]> for Ledger {
    fn from(energies: [NamedEnergy; K]) -> Self {
        let mut ledger = Ledger::default();
        energies.into_iter().for_each(|energy| ledger.add(energy));
        ledger
    }
}

/// Continues energies up to the start of a step, or of a part of it, by those of this step or part. What accrues adds
/// up; what follows from the state takes its last value and keeps its first start. An energy that no longer occurs
/// stays as it was.
pub fn continued(mut so_far: Vec<NamedEnergy>, step: &[NamedEnergy]) -> Vec<NamedEnergy> {
    for energy in step {
        match so_far.iter_mut().find(|sum| sum.is_same(energy)) {
            Some(NamedEnergy { amount: Amount::Accrued(sum), .. }) => *sum += energy.amount.growth(),
            Some(NamedEnergy { amount: Amount::State { now, .. }, .. }) => *now = energy.amount.value(),
            None => so_far.push(energy.clone()),
        }
    }
    so_far
}

/// Adds up energies over all ranks, each of which has the same energies in the same order.
pub fn sum_over_ranks(energies: &mut [NamedEnergy], ranks: &Ranks) {
    for NamedEnergy { amount, .. } in energies {
        match amount {
            Amount::Accrued(energy) => *energy = ranks.total(*energy),
            Amount::State { now, start } => [*now, *start] = [*now, *start].map(|of| ranks.total(of)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_of_one_name_add_up() {
        let mut ledger = Ledger::from([
            NamedEnergy::stored("kinetic", [1.0, 3.0]),
            NamedEnergy::dissipated(Ledger::FRICTION, 0.5),
            NamedEnergy::stored("kinetic", [2.0, 2.5]),
        ]);
        ledger.add(NamedEnergy::supplied("kinetic", 8.0));
        assert_eq!(ledger.iter().count(), 3);
        assert_eq!(ledger.energy(Ledger::FRICTION), 0.5);
        let further = ledger.further();
        assert_eq!(further.iter().map(NamedEnergy::unexplained).collect::<Vec<_>>(), [-2.5, 8.0]);
    }

    #[test]
    fn a_run_counts_from_its_first_step() {
        let step = |[start, now]: [f64; 2], lost| {
            [NamedEnergy::stored("kinetic", [start, now]), NamedEnergy::dissipated("heat", lost)]
        };
        let first = continued(Vec::new(), &step([4.0, 3.0], 0.75));
        // What is lost between two steps remains unexplained.
        let second = continued(first, &step([2.5, 2.0], 0.5));
        assert_eq!(second.iter().map(|of| of.amount.value()).collect::<Vec<_>>(), [2.0, 1.25]);
        assert_eq!(second.iter().map(NamedEnergy::unexplained).sum::<f64>(), 2.0 - 1.25);
    }
}
