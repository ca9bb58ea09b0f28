//! Corners in a grid that may be shifted and turned with respect to the target.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::CornerQuality;

/// Column and row in the lattice.
pub type Node = [i32; 2];

/// The directions from a node to its four neighbours.
pub const SIDES: [Node; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// A corner found in the image.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// u and v.
    pub position: Vector2<f64>,
    pub sigma_px: f64,
    pub filled: bool,
    pub quality: CornerQuality,
}

/// Corners by node, in the order of columns, then rows: that order makes every sum over them reproducible.
#[derive(Clone, Debug)]
pub struct Lattice {
    nodes: BTreeMap<Node, Found>,
    /// Part of a step in which a corner's surroundings are as on a chessboard: less than 1 where something is printed in the
    /// squares.
    pub clear: f64,
}

impl Default for Lattice {
    fn default() -> Self {
        Self { nodes: BTreeMap::new(), clear: 1.0 }
    }
}

impl Lattice {
    /// The lattice of a target on which surroundings are clear in this part of a step.
    pub fn looked_at_within(self, clear: f64) -> Self {
        Self { clear, ..self }
    }

    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    pub fn iter(&self) -> impl Iterator<Item = (&Node, &Found)> {
        self.nodes.iter()
    }

    pub fn get(&self, node: Node) -> Option<&Found> {
        self.nodes.get(&node)
    }

    pub fn get_mut(&mut self, node: Node) -> Option<&mut Found> {
        self.nodes.get_mut(&node)
    }

    pub fn insert(&mut self, node: Node, found: Found) {
        self.nodes.insert(node, found);
    }

    pub fn remove(&mut self, node: Node) {
        self.nodes.remove(&node);
    }

    /// Moves every corner.
    pub fn move_each(&mut self, to: impl Fn(Vector2<f64>) -> Vector2<f64>) {
        self.nodes.values_mut().for_each(|found| found.position = to(found.position));
    }

    /// Least and greatest node of the rectangle about all corners.
    pub fn bounds(&self) -> Option<[Node; 2]> {
        let (&first, _) = self.nodes.first_key_value()?;
        let join = |[low, high]: [Node; 2], node: &Node| {
            [[low[0].min(node[0]), low[1].min(node[1])], [high[0].max(node[0]), high[1].max(node[1])]]
        };
        Some(self.nodes.keys().fold([first, first], join))
    }

    /// The corners of the square of nodes up to `reach` from `node`, that at `node` itself left out.
    pub fn around(&self, node: Node, reach: i32) -> impl Iterator<Item = (Node, &Found)> {
        let columns = node[0] - reach..=node[0] + reach;
        columns
            .flat_map(move |i| self.nodes.range([i, node[1] - reach]..=[i, node[1] + reach]))
            .map(|(&at, found)| (at, found))
            .filter(move |(at, _)| *at != node)
    }

    /// Drops corners that belong to no cell with four corners. Where the squares meet something dark, a single false
    /// corner may look like one of the target.
    pub fn drop_loose(&mut self) {
        let has = |[i, j]: Node| self.nodes.contains_key(&[i, j]);
        let in_cell = |[i, j]: Node| {
            [[-1, -1], [-1, 1], [1, -1], [1, 1]]
                .iter()
                .any(|[di, dj]| has([i + di, j]) && has([i, j + dj]) && has([i + di, j + dj]))
        };
        let loose: Vec<Node> = self.nodes.keys().copied().filter(|&node| !in_cell(node)).collect();
        for node in loose {
            self.nodes.remove(&node);
        }
    }

    /// A lattice of the same corners with every node renamed by `label`.
    pub fn relabelled(&self, label: impl Fn(Node) -> Node) -> Self {
        Self { nodes: self.nodes.iter().map(|(&node, &found)| (label(node), found)).collect(), ..*self }
    }
}
