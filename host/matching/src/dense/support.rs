//! Support of disparities by their neighbours: which pixels are connected on one surface.
//!
//! Wrong disparities form small patches, because neighbours pull each other along the paths of the search. A patch that
//! is connected with no larger surface is removed (H. Hirschmüller, PAMI 30(2), 2008, section 2.5.1).

/// Largest difference in disparity, in pixels, of connected neighbours.
const CONNECTED: f32 = 1.0;

/// Whether each pixel belongs to a surface of fewer than `least` pixels, connected along rows and columns. Disparities
/// are NaN where there are none.
pub(super) fn isolated(disparities: &[f32], width: usize, least: u32) -> Vec<bool> {
    let mut sets = Sets((0..disparities.len() as u32).collect());
    let connected = |one: usize, other: usize| (disparities[one] - disparities[other]).abs() <= CONNECTED;
    for (index, disparity) in disparities.iter().enumerate() {
        if disparity.is_nan() {
            continue;
        }
        if index % width > 0 && connected(index, index - 1) {
            sets.join(index, index - 1);
        }
        if index >= width && connected(index, index - width) {
            sets.join(index, index - width);
        }
    }
    let roots: Vec<u32> = (0..disparities.len()).map(|index| sets.root(index as u32)).collect();
    let mut sizes = vec![0_u32; disparities.len()];
    roots.iter().for_each(|&root| sizes[root as usize] += 1);
    roots.iter().map(|&root| sizes[root as usize] < least).collect()
}

/// Disjoint sets of pixels, each by its parent; a root is its own parent.
struct Sets(Vec<u32>);

impl Sets {
    fn root(&mut self, mut index: u32) -> u32 {
        let parents = &mut self.0;
        while parents[index as usize] != index {
            let grandparent = parents[parents[index as usize] as usize];
            parents[index as usize] = grandparent;
            index = grandparent;
        }
        index
    }

    /// Makes the smaller root the common one.
    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one as u32), self.root(other as u32));
        self.0[one.max(other) as usize] = one.min(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_counted_across_rows_and_not_across_steps() {
        const NONE: f32 = f32::NAN;
        // A ring of seven, a single pixel in it two pixels nearer, and a pair beyond a gap.
        let disparities = [
            5.0, 5.5, 6.0, NONE, 9.0, //
            5.0, 8.0, 6.5, NONE, 9.5, //
            5.2, 5.8, NONE, NONE, NONE,
        ];
        let found: Vec<u8> = isolated(&disparities, 5, 3).into_iter().map(u8::from).collect();
        assert_eq!(found, [0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 0, 0, 1, 1, 1]);
        assert!(isolated(&disparities, 5, 8).into_iter().all(|small| small));
    }
}
