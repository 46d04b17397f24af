//! The parts of a load step on the examples of `inputs/`: basis, assembly, factorisation and solution.

use std::path::Path;

use mpm::assembly::Wanted;
use mpm::basis::Connectivity;
use mpm::deck::{build::build, load::load_text};
use mpm::dofs::DofMap;
use mpm::grid::Grid;
use mpm::linear::{Direct, FactorSize, Factorisation, FreeEntries, ordering};
use mpm::model::Model;
use mpm::points::Points;
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid};
use mpm::terms::Sum;

use crate::calibration::Machine;
use crate::clock::{exponent, least};
use crate::count::{Kernel, Work, work};

/// An example at several sizes.
struct Example {
    name: &'static str,
    deck: &'static str,
    method: &'static str,
    /// A text in the deck and the text that replaces it, to select a different law.
    law: [&'static str; 2],
    /// Points per cell along each axis.
    per_cell: usize,
    spacings: &'static [f64],
}

const PLANE: &[f64] = &[0.5, 0.25, 0.125];
const SPACE: &[f64] = &[1.0, 0.5, 0.25];
const NEO_HOOKEAN: &str = "model: neo-hookean";
const VON_MISES: &str = "deviatoric_yield_stress: 20e3, model: von-mises";

const fn plane(name: &'static str, deck: &'static str, method: &'static str) -> Example {
    Example { name, deck, method, law: ["", ""], per_cell: 6, spacings: PLANE }
}

const fn space(name: &'static str, method: &'static str, law: &'static str) -> Example {
    Example { name, deck: "block/block.yaml", method, law: [NEO_HOOKEAN, law], per_cell: 3, spacings: SPACE }
}

const fn sparse(example: Example) -> Example {
    Example { per_cell: 2, ..example }
}

const EXAMPLES: [Example; 20] = [
    plane("plane, Hencky", "beam.yaml", "mpm"),
    plane("plane, Hencky", "beam.yaml", "gimp"),
    sparse(plane("plane, Hencky", "beam.yaml", "gimp")),
    plane("plane, Hencky", "beam.yaml", "cpdi1"),
    plane("plane, Hencky", "beam.yaml", "cpdi2"),
    plane("plane, von Mises", "collapse.yaml", "mpm"),
    plane("plane, von Mises", "collapse.yaml", "gimp"),
    sparse(plane("plane, von Mises", "collapse.yaml", "gimp")),
    plane("plane, von Mises", "collapse.yaml", "cpdi2"),
    sparse(plane("plane, von Mises", "collapse.yaml", "cpdi2")),
    Example {
        name: "revolved, von Mises",
        deck: "cylinder.yaml",
        method: "mpm",
        law: ["points_per_cell: 2", "points_per_cell: 6"],
        per_cell: 6,
        spacings: &[0.0625, 0.015625, 0.00390625],
    },
    space("space, neo-Hookean", "mpm", NEO_HOOKEAN),
    space("space, neo-Hookean", "gimp", NEO_HOOKEAN),
    sparse(space("space, neo-Hookean", "gimp", NEO_HOOKEAN)),
    space("space, neo-Hookean", "cpdi1", NEO_HOOKEAN),
    space("space, neo-Hookean", "cpdi2", NEO_HOOKEAN),
    space("space, Hencky", "mpm", "model: hencky"),
    space("space, von Mises", "mpm", VON_MISES),
    space("space, von Mises", "gimp", VON_MISES),
    sparse(space("space, von Mises", "gimp", VON_MISES)),
];

/// Cost of one size of an example.
struct Measured {
    points: f64,
    unknowns: f64,
    links: f64,
    /// Time to compute the basis functions, [s]; other times are in the same unit.
    basis: f64,
    assembly: f64,
    factorise: f64,
    factor: FactorSize,
    kind: Factorisation,
    solve: f64,
    work: Work,
}

/// Prints the cost of every selected example on its finest grid, and the growth of the cost with the size.
pub fn print(machine: &Machine, only: Option<&str>) {
    let wanted = |e: &&Example| only.is_none_or(|text| format!("{} {}", e.name, e.method).contains(text));
    let all: Vec<(&Example, Vec<Measured>)> = EXAMPLES
        .iter()
        .filter(wanted)
        .map(|e| (e, e.spacings.iter().map(|&h| e.measure(h)).collect()))
        .collect();

    println!("\n## Basis and assembly\n");
    println!(
        "| Example | Method | in a cell | points | nodes of a point | basis (µs) | growth | assembly (µs) | growth \
              | GFLOP/s | of calibration | GB/s | of triad |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (example, sizes) in &all {
        let Some(finest) = sizes.last() else { continue };
        let growth = |cost: &dyn Fn(&Measured) -> f64| {
            exponent(&sizes.iter().map(|m| (m.points, cost(m))).collect::<Vec<_>>())
        };
        let (flops, bytes) =
            (finest.work.flops / finest.assembly * 1e-9, finest.work.bytes / finest.assembly * 1e-9);
        println!(
            "| {} | {} | {}{} | {} | {:.1} | {:.3} | {:.2} | {:.3} | {:.2} | {flops:.1} | {:.0} % | {bytes:.1} | {:.0} % |",
            example.name,
            example.method,
            example.per_cell,
            if example.deck.starts_with("block") { "³" } else { "²" },
            finest.points,
            finest.links / finest.points,
            finest.basis / finest.points * 1e6,
            growth(&|m| m.basis),
            finest.assembly / finest.points * 1e6,
            growth(&|m| m.assembly),
            100.0 * flops / machine.separate,
            100.0 * bytes / machine.triad,
        );
    }

    println!("\n## Linear systems\n");
    println!(
        "| Example | Method | unknowns | by | factorise (ms) | growth | GFLOP/s | of calibration | solve (ms) | growth | GB/s \
         | of triad |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for (example, sizes) in &all {
        let Some(finest) = sizes.last() else { continue };
        let growth = |cost: &dyn Fn(&Measured) -> f64| {
            exponent(&sizes.iter().map(|m| (m.unknowns, cost(m))).collect::<Vec<_>>())
        };
        let flops = finest.factor.operations / finest.factorise * 1e-9;
        // The substitutions read the factor twice: once forwards and once backwards.
        let bytes = 2.0 * 8.0 * finest.factor.entries as f64 / finest.solve * 1e-9;
        println!(
            "| {} | {} | {} | {} | {:.2} | {:.2} | {flops:.1} | {:.0} % | {:.3} | {:.2} | {bytes:.1} | {:.0} % |",
            example.name,
            example.method,
            finest.unknowns,
            match finest.kind {
                Factorisation::Cholesky => "LLᵀ",
                Factorisation::Ldlt => "LDLᵀ",
                _ => "LU",
            },
            finest.factorise * 1e3,
            growth(&|m| m.factorise),
            100.0 * flops / machine.fused,
            finest.solve * 1e3,
            growth(&|m| m.solve),
            100.0 * bytes / machine.triad,
        );
    }
}

impl Example {
    fn measure(&self, spacing: f64) -> Measured {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs").join(self.deck);
        let text = std::fs::read_to_string(&path).expect("a deck of this repository");
        let text = if self.law[0].is_empty() { text } else { text.replace(self.law[0], self.law[1]) };
        let mut set =
            vec![("h".to_owned(), spacing.to_string()), ("method".to_owned(), self.method.to_owned())];
        if text.contains("{n}") {
            set.push(("n".to_owned(), self.per_cell.to_string()));
        }
        let name = path.display().to_string();
        let deck = load_text(&name, text.as_bytes(), &set).unwrap_or_else(|e| panic!("{}", e.render(false)));
        let broken = "a deck of this repository can be built";
        match self.deck {
            "block/block.yaml" if self.law[1] == NEO_HOOKEAN => {
                measure::<3, Solid>(Kernel::Isotropic, build(&deck).expect(broken))
            }
            "block/block.yaml" => measure::<3, Solid>(Kernel::Solid, build(&deck).expect(broken)),
            "cylinder.yaml" => measure::<2, Axisymmetric>(Kernel::Revolved, build(&deck).expect(broken)),
            _ => measure::<2, PlaneStrain>(Kernel::Plane, build(&deck).expect(broken)),
        }
    }
}

fn measure<const D: usize, M: Mechanics<D>>(
    kernel: Kernel,
    (model, mut points): (Model<D>, Points<D>),
) -> Measured {
    shrink(model.grid.as_ref(), &mut points);
    let methods = model.methods();
    let grid = model.grid.as_ref();
    let mut kept = Some(Connectivity::new(grid, &mut points, &methods).expect("points lie in the grid"));
    let basis = least(|| {
        let old = kept.take().unwrap_or_default();
        kept = old.renew(grid, &mut points, &methods).ok();
    });
    let links = kept.expect("points lie in the grid");
    let delta_d: Vec<[f64; D]> =
        links.active_nodes().iter().map(|&node| motion(&grid.node_position(node as usize))).collect();
    let mut sum =
        Sum::from_model::<M>(&StepContext::first(&model, &links), &points).expect("loads are finite");
    let assembly = least(|| {
        sum.evaluate(&StepContext::first(&model, &links), &mut points, At::new(&delta_d), Wanted::Stiffness)
            .expect("the motion is possible")
    });

    let end = model.stepping.end_time / model.stepping.count as f64;
    let dofs = DofMap::new(&model, &points, &links, 0.0, end).expect("conditions agree");
    let entries = FreeEntries::new(&sum.system().matrix(), dofs.numbering());
    let mut values = Vec::new();
    entries.values(&sum.system().matrix(), &mut values);
    let n = entries.pattern.n;
    let pairs = entries.pattern.row.len() / (D * D);
    let mut direct = Direct::default();
    let lattice = |active: usize| grid.lattice(links.active_nodes()[active] as usize);
    let coordinates: Vec<[u32; D]> = (0..links.n_active()).map(lattice).collect();
    let order = || -> Vec<usize> {
        let nodes = ordering::nested_dissection(&coordinates, sum.system().matrix().reach(lattice));
        nodes
            .iter()
            .flat_map(|&node| (0..D).map(move |axis| (node, axis)))
            .filter_map(|(n, a)| dofs.free(n, a))
            .collect()
    };
    direct.analyse(entries.pattern, order()).expect("the factor fits into memory");
    let kind = direct.factorise(&values).expect("the stiffness is regular");
    let factorise = least(|| {
        direct.factorise(&values).expect("the stiffness is regular");
    });
    let solve = least(|| direct.solve(&mut vec![1.0; n]).expect("the stiffness is regular"));
    Measured {
        points: points.len() as f64,
        unknowns: n as f64,
        links: links.n_links() as f64,
        basis,
        assembly,
        factorise,
        solve,
        factor: direct.factor_size(),
        kind,
        work: work(kernel, &links, points.len(), pairs, points.history_len),
    }
}

/// Shrinks the bodies towards the lowest corner of the grid, so that the domains of points do not end at cell sides. In
/// an analysis, they end there only in the first step.
fn shrink<const D: usize>(grid: &dyn Grid<D>, points: &mut Points<D>) {
    const BY: f64 = 0.96;
    let [low, _] = grid.bounds();
    for x in points.converged.position.iter_mut().chain(&mut points.converged.corners) {
        for d in 0..D {
            x[d] = low[d] + BY * (x[d] - low[d]);
        }
    }
    points.converged.half_lengths.iter_mut().flatten().for_each(|l| *l *= BY);
}

/// Displacement, [length], that strains the bodies by up to three per cent, so that some von Mises points of the
/// examples yield.
fn motion<const D: usize>(place: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|d| 0.03 * (place[d] + 0.7 * place[(d + 1) % D]).sin())
}
