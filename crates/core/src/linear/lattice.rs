//! Nodes on a lattice and on the next coarser lattice, and the transfer of fields between them.

use crate::ranks::Ranks;

/// Marks a lattice position without a node.
const NOTHING: u32 = u32::MAX;

/// Coordinates of the lines of a lattice along one axis, [length], ascending; `None` if they are evenly spaced.
pub(super) type LatticeLines = Option<Vec<f64>>;

/// Nodes at lattice positions, and the reach of couplings along each axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lattice<const D: usize> {
    /// Position of each node; the lowest position along each axis, over all ranks, is 0.
    pub place: Vec<[u32; D]>,
    /// Largest distance along each axis between two nodes that are coupled.
    pub reach: [u32; D],
    /// Number of positions along each axis.
    extent: [u32; D],
    /// Node at each position, with the first axis fastest; empty if there are several ranks.
    node: Vec<u32>,
    /// The lines along each axis, from position 0 on.
    lines: [LatticeLines; D],
}

impl<const D: usize> Lattice<D> {
    /// The lattice of nodes at distinct positions; `lines` are the lines along each axis, numbered like the positions.
    pub(super) fn new(mut place: Vec<[u32; D]>, reach: [u32; D], lines: [LatticeLines; D]) -> Self {
        let mut low = [u32::MAX; D];
        for p in &place {
            for d in 0..D {
                low[d] = low[d].min(p[d]);
            }
        }
        let mut extent = [1; D];
        for p in &mut place {
            for d in 0..D {
                p[d] -= low[d];
                extent[d] = extent[d].max(p[d] + 1);
            }
        }
        let all = extent.iter().map(|&n| n as usize).product();
        let lines = lines_of(lines, low, extent);
        let mut lattice = Lattice { place, reach, extent, node: vec![NOTHING; all], lines };
        for n in 0..lattice.place.len() {
            let number = lattice.number(lattice.place[n]);
            lattice.node[number] = n as u32;
        }
        lattice
    }

    /// The lattice that all ranks share, with the nodes of this rank.
    pub(super) fn shared(
        ranks: &Ranks,
        mut place: Vec<[u32; D]>,
        reach: [u32; D],
        lines: [LatticeLines; D],
    ) -> Self {
        // Largest values along each axis; the lowest position is included with its sign changed.
        let mut largest = vec![f64::NEG_INFINITY; 3 * D];
        for d in 0..D {
            largest[2 * D + d] = f64::from(reach[d]);
            for p in place.iter().map(|p| f64::from(p[d])) {
                largest[d] = largest[d].max(-p);
                largest[D + d] = largest[D + d].max(p);
            }
        }
        ranks.maximum(&mut largest);
        // Without nodes, the values are infinite and the conversions saturate.
        let low: [u32; D] = std::array::from_fn(|d| -largest[d] as u32);
        let extent = std::array::from_fn(|d| (largest[D + d] as u32).saturating_sub(low[d]) + 1);
        for p in &mut place {
            *p = std::array::from_fn(|d| p[d] - low[d]);
        }
        let reach = std::array::from_fn(|d| largest[2 * D + d] as u32);
        Lattice { place, reach, extent, node: Vec::new(), lines: lines_of(lines, low, extent) }
    }

    pub(super) fn len(&self) -> usize {
        self.place.len()
    }

    fn number(&self, place: [u32; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * self.extent[d] as usize + place[d] as usize)
    }

    /// Number of positions.
    pub(super) fn places(&self) -> u64 {
        self.extent.iter().map(|&n| u64::from(n)).product()
    }

    /// The number of a position, with the first axis fastest. It is the same on all ranks.
    pub(super) fn key(&self, place: [u32; D]) -> u64 {
        (0..D).rev().fold(0, |key, d| key * u64::from(self.extent[d]) + u64::from(place[d]))
    }

    /// The position with this number.
    pub(super) fn place_of(&self, mut key: u64) -> [u32; D] {
        std::array::from_fn(|d| {
            let along = key % u64::from(self.extent[d]);
            key /= u64::from(self.extent[d]);
            along as u32
        })
    }

    /// Calls `visit(node)` for all nodes within `reach` of a position, in lattice order.
    pub(super) fn for_each_near(&self, place: [u32; D], reach: [u32; D], mut visit: impl FnMut(u32)) {
        let low: [u32; D] = std::array::from_fn(|d| place[d].saturating_sub(reach[d]));
        let high: [u32; D] = std::array::from_fn(|d| (place[d] + reach[d]).min(self.extent[d] - 1));
        if (0..D).any(|d| low[d] > high[d]) {
            return;
        }
        let mut at = low;
        loop {
            let node = self.node[self.number(at)];
            if node != NOTHING {
                visit(node);
            }
            let Some(d) = (0..D).find(|&d| at[d] < high[d]) else { return };
            at[..d].copy_from_slice(&low[..d]);
            at[d] += 1;
        }
    }

    /// Number of colours; no two nodes of the same colour are coupled.
    pub(super) fn n_colours(&self) -> usize {
        self.reach.iter().map(|&r| r as usize + 1).product()
    }

    /// The colour of a position.
    pub(super) fn colour(&self, place: [u32; D]) -> usize {
        (0..D).rev().fold(0, |c, d| {
            let period = self.reach[d] + 1;
            c * period as usize + (place[d] % period) as usize
        })
    }

    /// The first `own` nodes grouped by colour, ascending; a colour can be without nodes.
    pub(super) fn colours(&self, own: usize) -> Vec<Vec<u32>> {
        let mut colours = vec![Vec::new(); self.n_colours()];
        for (n, place) in self.place[..own].iter().enumerate() {
            colours[self.colour(*place)].push(n as u32);
        }
        colours
    }

    /// The lattice of every other line, without nodes.
    pub(super) fn above(&self) -> Lattice<D> {
        let extent = self.extent.map(|n| n / 2 + 1);
        // A reach of r along an axis becomes a reach of at most (r + 2) / 2 on the coarse lattice.
        let reach = self.reach.map(|r| (r + 2) / 2);
        let lines = std::array::from_fn(|d| {
            let fine = self.lines[d].as_ref()?;
            Some((0..=extent[d] as usize).map(|k| line(fine, 2 * k)).collect())
        });
        Lattice { place: Vec::new(), reach, extent, node: Vec::new(), lines }
    }

    /// The lattice of every other line, with the nodes from which the nodes of this lattice can be interpolated, and
    /// the interpolation.
    pub(super) fn coarsen(&self) -> (Lattice<D>, Transfer) {
        let mut coarse = self.above();
        let extent = coarse.extent;
        coarse.node = vec![NOTHING; extent.iter().map(|&n| n as usize).product()];
        for place in &self.place {
            self.for_each_parent(place, |parent, _| {
                let number = coarse.number(parent);
                coarse.node[number] = 0;
            });
        }
        let mut at = [0; D];
        for number in 0..coarse.node.len() {
            if coarse.node[number] != NOTHING {
                coarse.node[number] = coarse.place.len() as u32;
                coarse.place.push(at);
            }
            for d in 0..D {
                at[d] += 1;
                if at[d] < extent[d] {
                    break;
                }
                at[d] = 0;
            }
        }
        let transfer =
            Transfer::new(self, self.len(), coarse.len(), |place| coarse.node[coarse.number(place)]);
        (coarse, transfer)
    }

    /// Calls `visit(place, weight)` for the positions of the coarser lattice around a position of this one. The weights
    /// interpolate linearly for any spacing of the lines.
    pub(super) fn for_each_parent(&self, place: &[u32; D], mut visit: impl FnMut([u32; D], f32)) {
        let weights: [[f32; 2]; D] = std::array::from_fn(|d| {
            if place[d].is_multiple_of(2) {
                return [1.0, 0.0];
            }
            let Some(lines) = &self.lines[d] else { return [0.5, 0.5] };
            let [low, here, high] =
                [-1, 0, 1].map(|k| line(lines, place[d].saturating_add_signed(k) as usize));
            let upper = ((here - low) / (high - low)) as f32;
            [1.0 - upper, upper]
        });
        for corner in 0..1usize << D {
            let upper = |d: usize| corner >> d & 1;
            if (0..D).any(|d| place[d].is_multiple_of(2) && upper(d) == 1) {
                continue;
            }
            let weight = (0..D).map(|d| weights[d][upper(d)]).product();
            visit(std::array::from_fn(|d| place[d] / 2 + upper(d) as u32), weight);
        }
    }
}

/// The lines along each axis from `low` to the line beyond the last position, from which nodes can be interpolated too.
fn lines_of<const D: usize>(
    mut lines: [LatticeLines; D],
    low: [u32; D],
    extent: [u32; D],
) -> [LatticeLines; D] {
    for (d, along) in lines.iter_mut().enumerate() {
        let (first, last) = (low[d] as usize, low[d].saturating_add(extent[d]) as usize);
        *along = along.take().map(|lines| (first..=last).map(|k| line(&lines, k)).collect());
    }
    lines
}

/// Coordinate of a line; lines continue beyond the last one with the same spacing.
fn line(lines: &[f64], number: usize) -> f64 {
    let last = lines.len().saturating_sub(1);
    let at = |k: usize| lines.get(k).copied().unwrap_or(0.0);
    if number <= last {
        return at(number);
    }
    at(last) + (number - last) as f64 * (at(last) - at(last.saturating_sub(1)))
}

/// Bilinear or trilinear interpolation between a lattice and the next coarser one. The weights of every node sum to
/// one, even at the boundary of the body, so linear fields are transferred exactly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Transfer {
    parent_start: Vec<u32>,
    parent: Vec<(u32, f32)>,
    child_start: Vec<u32>,
    child: Vec<(u32, f32)>,
}

impl Transfer {
    /// The transfer between the nodes of a lattice and `n_coarse` coarse nodes. The first `own` nodes of the lattice
    /// are listed as children; `node` finds coarse nodes by their positions.
    pub(super) fn new<const D: usize>(
        fine: &Lattice<D>,
        own: usize,
        n_coarse: usize,
        node: impl Fn([u32; D]) -> u32,
    ) -> Self {
        let mut parent_start = vec![0];
        let mut parent = Vec::new();
        let mut child_start = vec![0u32; n_coarse + 1];
        for (n, place) in fine.place.iter().enumerate() {
            fine.for_each_parent(place, |at, weight| {
                let node = node(at);
                parent.push((node, weight));
                child_start[node as usize + 1] += u32::from(n < own);
            });
            parent_start.push(parent.len() as u32);
        }
        for n in 0..n_coarse {
            child_start[n + 1] += child_start[n];
        }
        let mut next = child_start.clone();
        let mut child = vec![(0, 0.0); child_start[n_coarse] as usize];
        for n in 0..own {
            for &(above, weight) in &parent[parent_start[n] as usize..parent_start[n + 1] as usize] {
                child[next[above as usize] as usize] = (n as u32, weight);
                next[above as usize] += 1;
            }
        }
        Transfer { parent_start, parent, child_start, child }
    }

    /// Extends the list of coarse nodes to this length; no fine node of this rank is interpolated from the added nodes.
    pub(super) fn extend(&mut self, n_coarse: usize) {
        let end = self.child_start.last().copied().unwrap_or(0);
        self.child_start.resize(n_coarse + 1, end);
    }

    /// The coarse nodes from which a fine node is interpolated, with their weights.
    pub(super) fn parents(&self, fine: usize) -> &[(u32, f32)] {
        &self.parent[self.parent_start[fine] as usize..self.parent_start[fine + 1] as usize]
    }

    /// The fine nodes that are interpolated from a coarse node, with the weight of this node in each.
    pub(super) fn children(&self, coarse: usize) -> &[(u32, f32)] {
        &self.child[self.child_start[coarse] as usize..self.child_start[coarse + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(radius: i32) -> Vec<[u32; 3]> {
        let mut places = Vec::new();
        for z in -radius..=radius {
            for y in -radius..=radius {
                for x in -radius..=radius {
                    if x * x + y * y + z * z <= radius * radius + 3 {
                        places.push([x, y, z].map(|c| (c + radius + 5) as u32));
                    }
                }
            }
        }
        places
    }

    #[test]
    fn linear_fields_are_interpolated_exactly_on_every_level() {
        let mut fine = Lattice::new(ball(7), [1, 1, 1], [const { None }; 3]);
        while fine.len() > 27 {
            let (coarse, transfer) = fine.coarsen();
            assert!(coarse.len() < fine.len());
            for (n, place) in fine.place.iter().enumerate() {
                for d in 0..3 {
                    let at = |&(node, w): &(u32, f32)| w * 2.0 * coarse.place[node as usize][d] as f32;
                    let value: f32 = transfer.parents(n).iter().map(at).sum();
                    assert_eq!(value, place[d] as f32);
                }
            }
            fine = coarse;
        }
    }

    #[test]
    fn linear_fields_are_interpolated_exactly_between_graded_lines() {
        // The lines extend to the highest position of the ball, 19; one axis has evenly spaced lines.
        let graded = |ratio: f64| {
            Some(
                (0..20)
                    .scan((0.0, 1.0), |(x, h), _| {
                        *x += *h;
                        *h *= ratio;
                        Some(*x)
                    })
                    .collect::<Vec<f64>>(),
            )
        };
        let mut fine = Lattice::new(ball(7), [1, 1, 1], [graded(1.2), None, graded(0.85)]);
        assert_eq!(fine.lines[0].as_ref().map(|lines| lines[0]), graded(1.2).map(|lines| lines[5]));
        while fine.len() > 27 {
            let (coarse, transfer) = fine.coarsen();
            for (n, place) in fine.place.iter().enumerate() {
                for d in [0, 2] {
                    let at = |lattice: &Lattice<3>, place: u32| {
                        lattice.lines[d].as_ref().map_or(0.0, |l| line(l, place as usize))
                    };
                    let value: f64 = (transfer.parents(n).iter())
                        .map(|(node, w)| f64::from(*w) * at(&coarse, coarse.place[*node as usize][d]))
                        .sum();
                    let exact = at(&fine, place[d]);
                    assert!((value - exact).abs() < 1e-6 * exact.abs(), "{value} {exact}");
                }
                let sum: f32 = transfer.parents(n).iter().map(|(_, w)| w).sum();
                assert!((sum - 1.0).abs() < 1e-6);
            }
            fine = coarse;
        }
    }

    /// Two coarse nodes are coupled if fine nodes below them are coupled.
    #[test]
    fn the_reach_of_a_coarse_lattice_covers_all_couplings() {
        for reach in 1..6 {
            let fine = Lattice::new((0..60).map(|x| [x]).collect(), [reach], [None]);
            let (coarse, transfer) = fine.coarsen();
            let mut largest = 0;
            for i in 0..60 {
                fine.for_each_near([i], [reach], |j| {
                    for (a, _) in transfer.parents(i as usize) {
                        for (b, _) in transfer.parents(j as usize) {
                            largest = largest.max(a.abs_diff(*b));
                        }
                    }
                });
            }
            assert_eq!(coarse.reach, [largest], "{reach}");
        }
    }

    #[test]
    fn nodes_of_a_colour_are_not_coupled() {
        let lattice = Lattice::new(ball(4), [1, 2, 1], [const { None }; 3]);
        let colours = lattice.colours(lattice.len());
        assert_eq!(colours.iter().map(Vec::len).sum::<usize>(), lattice.len());
        for nodes in colours {
            for (k, &a) in nodes.iter().enumerate() {
                for &b in &nodes[..k] {
                    let (a, b) = (lattice.place[a as usize], lattice.place[b as usize]);
                    assert!((0..3).any(|d| a[d].abs_diff(b[d]) > lattice.reach[d]), "{a:?} {b:?}");
                }
            }
        }
    }
}
