//! Runs on several machines: the ranks that `mpirun` or `srun` starts, and the library that solves their equations.

use std::cell::Cell;

use anyhow::bail;

use crate::deck::load::LoadedDeck;
use crate::deck::ready::Analysis;
use crate::ranks::Ranks;

/// Environment variables through which MPI launchers tell a process the number of ranks.
const LAUNCHERS: [&str; 4] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "MPI_LOCALNRANKS"];
/// The variable that is set if the launcher tells the number of ranks only through PMIx.
const PMIX: &str = "PMIX_RANK";

/// The optional features of this build of the program.
pub fn features() -> String {
    #[cfg(feature = "petsc")]
    return format!("petsc ({})", mpm_petsc::version());
    #[cfg(not(feature = "petsc"))]
    "none; `--features petsc` adds runs on several machines".to_owned()
}

/// The machines of a run.
pub struct Machines {
    ranks: Ranks,
    /// True once the run has begun, or a rank has withdrawn.
    has_begun: Cell<bool>,
    /// True if PETSc solves the equations.
    #[cfg(feature = "petsc")]
    solves: bool,
    /// Ends MPI and PETSc.
    #[cfg(feature = "petsc")]
    _session: Option<mpm_petsc::Session>,
}

impl Machines {
    /// A run of this process alone.
    pub fn alone() -> Self {
        Machines {
            ranks: Ranks::default(),
            has_begun: Cell::new(false),
            #[cfg(feature = "petsc")]
            solves: false,
            #[cfg(feature = "petsc")]
            _session: None,
        }
    }

    /// The ranks that a launcher has started. `options` are PETSc options; if they are given, PETSc solves the
    /// equations even of a single rank.
    ///
    /// # Errors
    /// If this build cannot divide a run between ranks, or MPI and PETSc cannot start.
    pub fn start(options: Option<&str>) -> anyhow::Result<Machines> {
        if options.is_none() && !is_launched() {
            return Ok(Machines::alone());
        }
        Machines::start_session(options)
    }

    #[cfg(feature = "petsc")]
    fn start_session(options: Option<&str>) -> anyhow::Result<Machines> {
        let session = match mpm_petsc::start(options.unwrap_or_default()) {
            Ok(session) => session,
            Err(error) => bail!("MPI and PETSc cannot start: {error}"),
        };
        let ranks = Ranks::new(session.communicator());
        let solves = options.is_some() || !ranks.is_alone();
        Ok(Machines { ranks, has_begun: Cell::new(false), solves, _session: Some(session) })
    }

    #[cfg(not(feature = "petsc"))]
    fn start_session(_: Option<&str>) -> anyhow::Result<Machines> {
        bail!(
            "this build of mpm runs on one machine only\n  help: install it with `cargo install --path . --features petsc`; \
             docs/how-to/machines.md describes how"
        )
    }

    /// The ranks of the run.
    pub fn ranks(&self) -> &Ranks {
        &self.ranks
    }

    /// Chooses the equation solvers for an analysis.
    #[cfg_attr(
        not(feature = "petsc"),
        expect(unused_variables, reason = "the solvers of the core are the only ones")
    )]
    pub fn equip(&self, analysis: &mut Analysis) {
        #[cfg(feature = "petsc")]
        if self.solves {
            analysis.solve_with(&std::sync::Arc::new(petsc::Petsc));
        }
    }

    /// Waits until all ranks have called this; returns the lowest rank that does not continue, if any.
    pub fn meet(&self, goes_on: bool) -> Option<usize> {
        let ended = self.ranks.gather_all(goes_on).iter().position(|goes_on| !goes_on);
        self.has_begun.set(ended.is_some());
        ended
    }

    /// True if all ranks have read the same deck, and the same files that the deck names. All ranks must call it
    /// together.
    pub fn have_the_same(&self, loaded: &LoadedDeck) -> bool {
        let hashes = if self.ranks.is_alone() { Vec::new() } else { self.ranks.gather_all(loaded.hash()) };
        hashes.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// Waits until all ranks are ready to run.
    ///
    /// # Errors
    /// If a rank has withdrawn; that rank has stated the reason.
    pub fn begin(&self) -> anyhow::Result<()> {
        let ended = self.meet(true);
        self.has_begun.set(true);
        if let Some(rank) = ended {
            bail!("the run has not begun, because rank {rank} has an error");
        }
        Ok(())
    }

    /// Unless the run has begun, tells the other ranks that this one does not take part.
    pub fn withdraw(&self) {
        if !self.has_begun.get() {
            self.meet(false);
        }
    }
}

/// True if an MPI launcher has started this process.
fn is_launched() -> bool {
    LAUNCHERS.iter().any(|name| std::env::var_os(name).is_some()) || std::env::var_os(PMIX).is_some()
}

#[cfg(feature = "petsc")]
mod petsc {
    use std::any::Any;

    use crate::linear::{Backends, Engine, Preconditioner};

    /// The PETSc solvers.
    #[derive(Debug)]
    pub struct Petsc;

    impl Petsc {
        /// The solvers for `N` components at each node.
        fn solvers<const D: usize, const N: usize>() -> Backends<D, N> {
            let multigrid = Box::new(Preconditioner::<D, N>::default());
            let iterative = mpm_petsc::Krylov::<D, N>::with_preconditioner(multigrid);
            Backends {
                direct: Some(Box::new(mpm_petsc::ByExtent::<D, N>::new())),
                iterative: iterative.ok().map(|solver| Box::new(solver) as _),
                algebraic: mpm_petsc::Krylov::<D, N>::new().ok().map(|solver| Box::new(solver) as _),
            }
        }
    }

    impl<const D: usize> Engine<D> for Petsc {
        fn backends(&self) -> Backends<D> {
            Petsc::solvers()
        }

        // One further component in the plane or in space; each number is compiled for itself.
        fn backends_with_fields(&self, components: usize) -> Option<Box<dyn Any>> {
            match components {
                3 => Some(Box::new(Petsc::solvers::<D, 3>())),
                4 => Some(Box::new(Petsc::solvers::<D, 4>())),
                _ => None,
            }
        }
    }
}
