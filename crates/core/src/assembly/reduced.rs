//! The equations for the unknowns, Cᵀ K C, if nodes are turned or tied.

use std::collections::BTreeMap;

use crate::basis::Connectivity;
use crate::dofs::DofMap;

use super::System;
use super::pattern::Couples;

impl<const N: usize> System<N> {
    /// Forms the matrix of the equations for the unknowns from the stiffness; does nothing if this matrix is the
    /// stiffness itself.
    pub fn reduce(&mut self, dofs: &DofMap<N>) {
        if dofs.is_plain() {
            return;
        }
        self.reduced.clone_from(&self.blocks);
        let mut is_transformed = vec![false; dofs.n_nodes()];
        dofs.for_each_transformed(|node| is_transformed[node] = true);
        let mut touched = Vec::new();
        self.pairs.for_each(|row, column, place| {
            if is_transformed[row] || is_transformed[column] {
                touched.push((row, column, place));
                self.reduced[place] = [[0.0; N]; N];
            }
        });
        let expressions = |node: usize| -> [Vec<(usize, usize, f64)>; N] {
            std::array::from_fn(|component| dofs.expression(node, component))
        };
        for (row, column, place) in touched {
            let (row_terms, column_terms) = (expressions(row), expressions(column));
            for (i, k) in (0..N).flat_map(|i| (0..N).map(move |k| (i, k))) {
                let entry = self.blocks[place][i][k];
                for &(a, component_a, weight_a) in &row_terms[i] {
                    for &(b, component_b, weight_b) in &column_terms[k] {
                        let value = weight_a * weight_b * entry;
                        self.add_reduced([a, component_a], [b, component_b], value);
                        // The mirror image of the entry, which a symmetric matrix does not store.
                        if self.is_symmetric() && row != column {
                            self.add_reduced([b, component_b], [a, component_a], value);
                        }
                    }
                }
            }
        }
    }

    fn add_reduced(&mut self, [row, i]: [usize; 2], [column, k]: [usize; 2], value: f64) {
        if let Some(place) = self.place(row, column) {
            self.reduced[place][i][k] += value;
        }
    }
}

/// The nodes that terms and ties couple: a node coupled to a tied node is also coupled to the nodes to which the latter
/// is tied.
pub(crate) fn with_ties<const D: usize, const N: usize>(
    dofs: &DofMap<N>,
    links: &Connectivity<D>,
    terms: &Couples,
    couple: &mut dyn FnMut(&[u32]),
) {
    let mut masters: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    dofs.for_each_tie(|node, to| masters.entry(node as u32).or_default().extend(to.map(|node| node as u32)));
    if masters.is_empty() {
        return terms(couple);
    }
    let mut extended = |nodes: &[u32]| {
        let tied = nodes.iter().filter_map(|node| masters.get(node));
        let mut all: Vec<u32> = tied.flatten().chain(nodes).copied().collect();
        all.sort_unstable();
        all.dedup();
        couple(&all);
    };
    terms(&mut extended);
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        if nodes.iter().any(|node| masters.contains_key(node)) {
            extended(nodes);
        }
    }
}
