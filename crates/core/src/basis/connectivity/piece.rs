//! Links of consecutive groups of points, with the grid numbers of the nodes.

use super::super::Support;
use super::super::factors::Form;
use super::super::slivers::Touch;
use crate::grid::Grid;

/// Links of consecutive groups, with grid node numbers, to be appended to the links of the previous groups.
#[derive(Default)]
pub(super) struct Piece<const D: usize> {
    pub(super) group_node_start: Vec<usize>,
    pub(super) group_nodes: Vec<u32>,
    /// All fields down to `cells` correspond to those of [`Connectivity`](super::Connectivity); offsets count from
    /// the start of the piece.
    pub(super) touches: Vec<Touch>,
    pub(super) whole: Vec<bool>,
    pub(super) start: Vec<usize>,
    pub(super) form: Vec<Form>,
    pub(super) local_start: Vec<usize>,
    pub(super) local: Vec<u32>,
    pub(super) value: Vec<f64>,
    pub(super) gradient: Vec<[f64; D]>,
    pub(super) factor: Vec<f64>,
    pub(super) cells: Vec<u32>,
    /// For each group, the index in `cells` of the first cell that its points touch.
    pub(super) cell_start: Vec<usize>,
    /// 1/h of an even grid along each axis, [1/length].
    per_length: Option<[f64; D]>,
    group: Group,
}

/// The group to which points are being added.
#[derive(Default)]
struct Group {
    n_points: usize,
    n_links: usize,
    /// Size of the cell of the group, [length].
    size: f64,
    /// The nodes that points touch, in the order in which points first touched them.
    nodes: Vec<u32>,
    /// The nodes of each point, unless they are the same as for the previous point.
    touched: Vec<u32>,
    /// For each entry of `touched`, how firmly points touch the node.
    touches: Vec<Touch>,
    /// From this index on, all entries of `touched` are known to be firm.
    firm_from: usize,
}

impl<const D: usize> Piece<D> {
    /// A piece without links; `per_length` is 1/h of an even grid along each axis.
    pub(super) fn new(per_length: Option<[f64; D]>) -> Self {
        Piece { per_length, ..Piece::default() }
    }

    /// Begins a group whose cell has this size, [length].
    pub(super) fn begin_group(&mut self, size: f64) {
        self.cell_start.push(self.cells.len());
        let Group { mut nodes, mut touched, mut touches, .. } = std::mem::take(&mut self.group);
        nodes.clear();
        touched.clear();
        touches.clear();
        self.group = Group { size, nodes, touched, touches, ..Group::default() };
    }

    /// Adds the next point of the group, which lies in this cell.
    #[inline]
    pub(super) fn add(&mut self, grid: &dyn Grid<D>, cell: u32, support: &Support<D>) {
        self.keep(grid, cell, support);
        let group = &mut self.group;
        group.n_points += 1;
        group.n_links += support.nodes.len();
        if !group.touched.ends_with(&support.nodes) {
            for node in &support.nodes {
                if !group.nodes.contains(node) {
                    group.nodes.push(*node);
                }
            }
            self.cells.extend_from_slice(&support.cells);
            group.touched.extend_from_slice(&support.nodes);
            group.touches.resize(group.touched.len(), Touch::Sliver);
            group.firm_from = group.touched.len();
        }
        let first = group.touched.len() - support.nodes.len();
        if first < group.firm_from {
            let mut all_firm = true;
            for (k, touch) in group.touches[first..].iter_mut().enumerate() {
                if *touch < Touch::Firm {
                    *touch = (*touch).max(Touch::new(support.value[k], &support.gradient[k], group.size));
                }
                all_firm &= *touch == Touch::Firm;
            }
            if all_firm {
                group.firm_from = first;
            }
        }
        self.local_start.push(self.local.len() + first);
    }

    /// Stores the basis functions of a point, as factors if they are given in this form.
    #[inline]
    fn keep(&mut self, grid: &dyn Grid<D>, cell: u32, support: &Support<D>) {
        if let Some(factors) = &support.factors {
            self.start.push(self.factor.len());
            let per_length = self.per_length.unwrap_or_else(|| {
                let per_length = grid.spacing(cell as usize).map(|h| 1.0 / h);
                self.factor.extend(per_length);
                per_length
            });
            self.form.push(factors.keep(&per_length, &mut self.factor));
        } else {
            self.start.push(self.value.len());
            self.form.push(Form::explicit(support.nodes.len()));
            self.value.extend_from_slice(&support.value);
            self.gradient.extend_from_slice(&support.gradient);
        }
    }

    /// Ends a group: lists its nodes in ascending order, and the indices of each point's nodes in this list.
    pub(super) fn end_group(&mut self) {
        let Group { n_points, n_links, nodes, touched, touches, .. } = &mut self.group;
        self.group_node_start.push(self.group_nodes.len());
        nodes.sort_unstable();
        self.local.extend(touched.iter().map(|n| nodes.partition_point(|m| m < n) as u32));
        let first = self.group_nodes.len();
        self.group_nodes.extend_from_slice(nodes);
        self.touches.resize(self.group_nodes.len(), Touch::Sliver);
        let locals = &self.local[self.local.len() - touched.len()..];
        for (&local, &touch) in locals.iter().zip(&*touches) {
            let firmest = &mut self.touches[first + local as usize];
            *firmest = (*firmest).max(touch);
        }
        self.whole.push(*n_links == *n_points * nodes.len());
    }
}
