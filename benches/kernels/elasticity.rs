//! Equations of linear elasticity on complete grids of quadrilaterals or hexahedra, a common benchmark for direct
//! solvers.

use mpm::linear::{Direct, Pattern, ordering};

use crate::calibration::Machine;
use crate::clock::least;
use crate::point::numbers;

/// Prints the cost of ordering and analysis, factorisation and solution.
pub fn print(machine: &Machine) {
    println!("\n## Linear elasticity\n");
    println!(
        "| Nodes | unknowns | entries of the factor | order and analyse (ms) | factorise (ms) | GFLOP/s | of calibration \
         | solve (ms) | GB/s | of triad |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    row::<2>(machine, "500²", 500);
    row::<3>(machine, "30³", 30);
}

fn row<const D: usize>(machine: &Machine, name: &str, n: usize) {
    let (pattern, values, places) = equations::<D>(n);
    let order = || -> Vec<usize> {
        let nodes = ordering::nested_dissection(&places, [1; D]);
        nodes.iter().flat_map(|&node| (0..D).map(move |d| D * node + d)).collect()
    };
    let mut direct = Direct::default();
    let analyse = least(|| {
        direct = Direct::default();
        direct.analyse(pattern.clone(), order()).expect("the factor fits into memory");
    });
    let factorise = least(|| {
        direct.factorise(&values).expect("the stiffness is positive definite");
    });
    let mut solution = vec![1.0; pattern.n];
    let solve = least(|| {
        solution.fill(1.0);
        direct.solve(&mut solution).expect("the stiffness is positive definite");
    });
    let size = direct.factor_size();
    let flops = size.operations / factorise * 1e-9;
    // The substitutions read the factor twice: once forwards and once backwards.
    let bytes = 2.0 * 8.0 * size.entries as f64 / solve * 1e-9;
    println!(
        "| {name} | {} | {} | {:.1} | {:.1} | {flops:.1} | {:.0} % | {:.2} | {bytes:.1} | {:.0} % |",
        pattern.n,
        size.entries,
        analyse * 1e3,
        factorise * 1e3,
        100.0 * flops / machine.fused,
        solve * 1e3,
        100.0 * bytes / machine.triad,
    );
}

/// Pattern and values of the stiffness of a grid with `n` nodes along each axis, and the positions of its free nodes.
/// The Young's moduli of the cells are random, and the lowest nodes along the last axis are fixed.
fn equations<const D: usize>(n: usize) -> (Pattern, Vec<f64>, Vec<[u32; D]>) {
    let place = |node: usize| -> [usize; D] { std::array::from_fn(|d| node / n.pow(d as u32) % n) };
    let number = |place: [usize; D]| (0..D).map(|d| place[d] * n.pow(d as u32)).sum::<usize>();
    let held = n.pow(D as u32 - 1);
    let n_nodes = n.pow(D as u32);
    let neighbours = 3usize.pow(D as u32);
    let mut blocks = vec![[[0.0; D]; D]; n_nodes * neighbours];
    let element = element::<D>();
    let mut random = numbers();
    for cell in (0..n_nodes).filter(|&cell| place(cell).iter().all(|&i| i + 1 < n)) {
        let young = 0.5 + random().abs();
        let corner = |c: usize| number(std::array::from_fn(|d| place(cell)[d] + (c >> d & 1)));
        for a in 0..1 << D {
            for b in 0..1 << D {
                let apart = |d: usize| 1 + (b >> d & 1) - (a >> d & 1);
                let neighbour: usize = (0..D).map(|d| apart(d) * 3usize.pow(d as u32)).sum();
                let block = &mut blocks[corner(a) * neighbours + neighbour];
                for i in 0..D {
                    for j in 0..D {
                        block[i][j] += young * element[a][b][i][j];
                    }
                }
            }
        }
    }
    let mut pattern =
        Pattern { n: D * (n_nodes - held), column_start: vec![0], row: Vec::new(), symmetric: true };
    let mut values = Vec::new();
    for node in held..n_nodes {
        for j in 0..D {
            for k in 0..neighbours {
                let other: [usize; D] =
                    std::array::from_fn(|d| (place(node)[d] + k / 3usize.pow(d as u32) % 3).wrapping_sub(1));
                if other.iter().any(|&i| i >= n) || number(other) < node {
                    continue;
                }
                for i in 0..D {
                    let row = D * (number(other) - held) + i;
                    if row >= D * (node - held) + j {
                        pattern.row.push(row);
                        values.push(blocks[node * neighbours + k][j][i]);
                    }
                }
            }
            pattern.column_start.push(pattern.row.len());
        }
    }
    (pattern, values, (held..n_nodes).map(|node| place(node).map(|i| i as u32)).collect())
}

/// The stiffness of a square or cube of side 1 with Young's modulus 1 and Poisson's ratio 0.3: one block for each pair
/// of corners.
fn element<const D: usize>() -> Vec<Vec<[[f64; D]; D]>> {
    let (lambda, mu) = (0.3 / (1.3 * 0.4), 0.5 / 1.3);
    let mut element = vec![vec![[[0.0; D]; D]; 1 << D]; 1 << D];
    let gauss = [0.5 - 0.75f64.sqrt() / 3.0, 0.5 + 0.75f64.sqrt() / 3.0];
    for q in 0..1usize << D {
        let hat = |c: usize, d: usize| {
            let x = gauss[q >> d & 1];
            if c >> d & 1 == 1 { (x, 1.0) } else { (1.0 - x, -1.0) }
        };
        let gradient = |c: usize| -> [f64; D] {
            std::array::from_fn(|d| (0..D).map(|e| if e == d { hat(c, e).1 } else { hat(c, e).0 }).product())
        };
        for (a, row) in element.iter_mut().enumerate() {
            for (b, block) in row.iter_mut().enumerate() {
                let (ga, gb) = (gradient(a), gradient(b));
                let dot: f64 = (0..D).map(|d| ga[d] * gb[d]).sum();
                for i in 0..D {
                    for j in 0..D {
                        let same = if i == j { mu * dot } else { 0.0 };
                        block[i][j] += (lambda * ga[i] * gb[j] + mu * ga[j] * gb[i] + same) / (1 << D) as f64;
                    }
                }
            }
        }
    }
    element
}
