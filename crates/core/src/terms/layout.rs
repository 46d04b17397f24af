//! Terms that keep places in the layout of the system, or memory that only evaluations need.

/// What a term keeps about the system of the current step.
pub trait Layout {
    /// True if the term couples more nodes than when the system was laid out;
    /// [`Term::couples`](super::Term::couples) then lists these nodes, too.
    fn outgrows(&self) -> bool {
        false
    }

    /// Called when the system has been laid out anew: indices of blocks are no longer valid.
    fn forget_layout(&mut self);

    /// Frees memory that only further evaluations of the step would need.
    fn conclude(&mut self) {}
}
