//! A hierarchy of bounding boxes, so that a ray is tested against few of the shapes.
//!
//! Each node has up to four children, whose boxes are tested side by side (H. Dammertz, J. Hanika and A. Keller,
//! "Shallow bounding volume hierarchies for fast SIMD ray tracing of incoherent rays", EGSR 2008), split where the
//! surface-area heuristic is least (J. Goldsmith and J. Salmon, IEEE CG&A 7(5), 1987).

use nalgebra::Vector3;

const WIDTH: usize = 4;

/// Added around each box (mm): more than single precision loses over a room, so that no shape is missed.
const PADDING_MM: f64 = 0.02;

/// From this depth on, groups are halved, which bounds the depth of any tree.
const BALANCED_DEPTH: u32 = 8;

/// Entries on the stack of a search: three per level, enough for 8 levels and a million shapes in balanced ones.
const STACK: usize = 64;

/// An axis-aligned box in world coordinates, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

/// A tree of boxes over a list of shapes. The first node is the root.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hierarchy {
    nodes: Vec<Node>,
}

/// Four boxes, axis by axis, and what is in them. Empty places have boxes that no ray enters.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    children: [Child; WIDTH],
}

/// A node (even) or a shape (odd): twice its index, and one for shapes. Small, because the stack is made for each ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Child(u32);

enum Content {
    Node(usize),
    Shape(usize),
}

impl Child {
    const ROOT: Self = Self(0);

    const fn new(content: &Content) -> Self {
        match *content {
            Content::Node(index) => Self(2 * index as u32),
            Content::Shape(index) => Self(2 * index as u32 + 1),
        }
    }

    #[inline]
    const fn content(self) -> Content {
        let index = (self.0 / 2) as usize;
        if self.0.is_multiple_of(2) { Content::Node(index) } else { Content::Shape(index) }
    }
}

impl Bounds {
    /// The box of half size `half` about `centre`.
    pub fn new(centre: Vector3<f64>, half: Vector3<f64>) -> Self {
        Self { low: centre - half.add_scalar(PADDING_MM), high: centre + half.add_scalar(PADDING_MM) }
    }

    fn union(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    fn around(bounds: &[Self], members: &[usize]) -> Option<Self> {
        members.iter().map(|&i| bounds[i]).reduce(|a, b| a.union(&b))
    }

    fn centre(&self) -> Vector3<f64> {
        0.5 * (self.low + self.high)
    }

    fn area(&self) -> f64 {
        let size = self.high - self.low;
        2.0 * (size.x * size.y + size.y * size.z + size.z * size.x)
    }
}

impl Hierarchy {
    /// Over shapes with these bounds.
    pub fn new(bounds: &[Bounds]) -> Self {
        let mut tree = Self::default();
        if !bounds.is_empty() {
            tree.grow(bounds, (0..bounds.len()).collect(), 0);
        }
        tree
    }

    /// Adds the subtree over `members` and returns its node.
    fn grow(&mut self, bounds: &[Bounds], members: Vec<usize>, depth: u32) -> usize {
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (place, group) in quarters(bounds, members, depth >= BALANCED_DEPTH).into_iter().enumerate() {
            let Some(whole) = Bounds::around(bounds, &group) else { continue };
            let content = match group[..] {
                [shape] => Content::Shape(shape),
                _ => Content::Node(self.grow(bounds, group, depth + 1)),
            };
            let node = &mut self.nodes[index];
            node.children[place] = Child::new(&content);
            for axis in 0..3 {
                node.low[axis][place] = whole.low[axis] as f32;
                node.high[axis][place] = whole.high[axis] as f32;
            }
        }
        index
    }

    /// Calls `meet(shape, limit)` for the shapes whose boxes the ray enters before `limit`, nearest boxes first.
    /// `meet` returns the new, shorter limit, or `None` if the shape is missed.
    #[inline]
    pub fn visit(
        &self,
        origin: Vector3<f64>,
        direction: Vector3<f64>,
        mut limit: f64,
        mut meet: impl FnMut(usize, f64) -> Option<f64>,
    ) {
        let start: [f32; 3] = std::array::from_fn(|axis| origin[axis] as f32);
        let inverse: [f32; 3] = std::array::from_fn(|axis| direction[axis].recip() as f32);
        let mut waiting = [(0.0_f32, Child::ROOT); STACK];
        let mut count = usize::from(!self.nodes.is_empty());
        while count > 0 {
            count -= 1;
            let (enter, child) = waiting[count];
            if f64::from(enter) > limit {
                continue;
            }
            let node = match child.content() {
                Content::Shape(shape) => {
                    limit = meet(shape, limit).unwrap_or(limit);
                    continue;
                }
                Content::Node(index) => &self.nodes[index],
            };
            let (enter, leave) = node.spans(&start, &inverse);
            let first = count;
            for place in 0..WIDTH {
                // Single precision may place the entry a little late; the limit is tested again on leaving the stack.
                if enter[place] <= leave[place] && count < STACK {
                    let mut slot = count;
                    while slot > first && waiting[slot - 1].0 < enter[place] {
                        waiting[slot] = waiting[slot - 1];
                        slot -= 1;
                    }
                    waiting[slot] = (enter[place], node.children[place]);
                    count += 1;
                }
            }
        }
    }
}

impl Node {
    const EMPTY: Self = Self {
        low: [[f32::INFINITY; WIDTH]; 3],
        high: [[f32::NEG_INFINITY; WIDTH]; 3],
        children: [Child::ROOT; WIDTH],
    };

    /// Where a ray enters and leaves the four boxes, by slabs; it misses those that it leaves before it enters.
    #[inline]
    fn spans(&self, origin: &[f32; 3], inverse: &[f32; 3]) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut enter, mut leave) = ([0.0_f32; WIDTH], [f32::INFINITY; WIDTH]);
        for axis in 0..3 {
            let flip = inverse[axis] < 0.0;
            let (near, far) = if flip { (&self.high, &self.low) } else { (&self.low, &self.high) };
            for place in 0..WIDTH {
                let a = (near[axis][place] - origin[axis]) * inverse[axis];
                let b = (far[axis][place] - origin[axis]) * inverse[axis];
                // Written so that a NaN, from a ray lying in a face, changes nothing.
                enter[place] = if a > enter[place] { a } else { enter[place] };
                leave[place] = if b < leave[place] { b } else { leave[place] };
            }
        }
        // The padding covers absolute rounding; this covers what grows with the distance.
        (enter.map(|x| x * (1.0 - 4.0 * f32::EPSILON)), leave.map(|x| x * (1.0 + 4.0 * f32::EPSILON)))
    }
}

/// Up to four groups of shapes, by splitting the one of the largest surface again and again.
///
/// If `balanced`, the most numerous one is halved instead.
fn quarters(bounds: &[Bounds], members: Vec<usize>, balanced: bool) -> Vec<Vec<usize>> {
    let mut groups = vec![members];
    while groups.len() < WIDTH {
        let area = |group: &Vec<usize>| match balanced {
            true => group.len() as f64,
            false => Bounds::around(bounds, group).map_or(0.0, |whole| whole.area()),
        };
        let divisible = groups.iter().enumerate().filter(|(_, group)| group.len() > 1);
        let Some((largest, _)) = divisible.max_by(|a, b| area(a.1).total_cmp(&area(b.1))) else { break };
        let mut group = groups.swap_remove(largest);
        let at = if balanced { group.len() / 2 } else { sort_for_split(bounds, &mut group) };
        let right = group.split_off(at);
        groups.extend([group, right]);
    }
    groups
}

/// Sorts along the axis, and returns the place, where the surfaces times the numbers of both parts are least.
fn sort_for_split(bounds: &[Bounds], members: &mut [usize]) -> usize {
    let sort = |members: &mut [usize], axis: usize| {
        members.sort_by(|&a, &b| bounds[a].centre()[axis].total_cmp(&bounds[b].centre()[axis]).then(a.cmp(&b)));
    };
    let mut best = (f64::INFINITY, 0, 1);
    for axis in 0..3 {
        sort(members, axis);
        let before = costs(bounds, members.iter());
        let after = costs(bounds, members.iter().rev());
        for at in 1..members.len() {
            let cost = before[at - 1] + after[members.len() - at - 1];
            if cost < best.0 {
                best = (cost, axis, at);
            }
        }
    }
    sort(members, best.1);
    best.2
}

/// Surface times number of the first 1, 2, … of `members`.
fn costs<'a>(bounds: &[Bounds], members: impl Iterator<Item = &'a usize>) -> Vec<f64> {
    let mut whole: Option<Bounds> = None;
    let mut count = 0.0;
    members
        .map(|&i| {
            let union = whole.map_or(bounds[i], |w| w.union(&bounds[i]));
            whole = Some(union);
            count += 1.0;
            count * union.area()
        })
        .collect()
}
