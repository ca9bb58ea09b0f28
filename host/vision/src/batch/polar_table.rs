//! Maps of a plane that no formula makes fast, as tables of polynomials: how batches compute lenses of other programs' models.
//!
//! A place of the plane lies in one of four sectors about the middle, by its slope there, and at a part of the distance to the rim of the field
//! in its direction. Both numbers are cut into cells, and in each cell the map is a polynomial through Chebyshev's nodes. So no cell sticks out of
//! the field. The part x of the distance counts by w = √(1 - x), by which an image that comes to a stand at the rim is smooth, as others are; for
//! one that comes to a stand a little beyond it, cells are the narrower the nearer they are to the rim: some for each octave of w. Tabulated is where
//! the image is along the direction of the place and across it, which hardly depends on that direction.

use std::f64::consts::{FRAC_PI_2, PI};

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::SMatrix;

use super::lanes::{ALWAYS_FUSED, multiply_add};

/// Terms of a polynomial along each of its two variables.
const TERMS: usize = 6;
/// Both coordinates of the image for each term of one variable.
const ROW: usize = 2 * TERMS;
/// Sectors about the middle.
const SECTORS: usize = 4;
/// Octaves of w, the logarithm of the number of cells in each, and cells across each sector: fewest first.
const CELLS: [[usize; 3]; 5] = [[3, 3, 2], [4, 4, 4], [4, 5, 12], [12, 4, 12], [12, 5, 12]];
/// So near to the rim, in w, the map itself is asked where no cell comes near: less than a thousandth of the field.
const ASKED: f64 = 1.0 / 64.0;
/// Places computed together.
const BLOCK: usize = 64;
/// Nearer to the rim than this part of the distance it is the map itself that says what is inside.
const RIM: f64 = 1e-8;

type Cell = [f64; TERMS * ROW];
/// A cell of which the table does not tell.
const UNTOLD: Cell = [f64::NAN; TERMS * ROW];
type Nodes = SMatrix<f64, TERMS, TERMS>;

/// A map from places to places, as a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PolarTable {
    octaves: usize,
    /// Logarithm of the number of cells of an octave.
    finer: usize,
    across: usize,
    middle: [f64; 2],
    middle_image: [f64; 2],
    /// The distance of the rim from the middle, for each cell across the sectors.
    rims: Vec<[f64; TERMS]>,
    cells: Vec<Cell>,
}

/// What is tabulated.
pub(super) trait PlaneMap: Sync {
    /// The middle of the field.
    fn middle(&self) -> [f64; 2];

    /// The image of the middle.
    fn middle_image(&self) -> [f64; 2];

    /// The distance of the rim from the middle in a direction.
    fn rim(&self, direction: f64) -> Option<f64>;

    /// The image of a place; `None` where it has none.
    fn image(&self, place: [f64; 2]) -> Option<[f64; 2]>;

    /// The largest error of an image.
    fn tolerance(&self) -> f64;
}

impl PolarTable {
    /// `None` where no table comes near enough.
    pub fn new(map: &impl PlaneMap) -> Option<Self> {
        CELLS.into_iter().find_map(|cells| Self::of_cells(map, cells))
    }

    /// Cells along the distance: those of the octaves, and one at the rim.
    const fn along(&self) -> usize {
        (self.octaves << self.finer) + 1
    }

    /// Where a cell begins and how long it is, in w. The first one is at the rim.
    fn cell_along(&self, row: usize) -> [f64; 2] {
        let in_octave = 1_usize << self.finer;
        let Some(place) = row.checked_sub(1) else { return [0.0, self.innermost()] };
        let octave = self.innermost() * f64::from(1_u32 << (place / in_octave));
        let length = octave / in_octave as f64;
        [octave + (place % in_octave) as f64 * length, length]
    }

    /// The length in w of the cell at the rim.
    fn innermost(&self) -> f64 {
        0.5_f64.powi(self.octaves as i32)
    }

    fn of_cells(map: &impl PlaneMap, [octaves, finer, across]: [usize; 3]) -> Option<Self> {
        let powers = to_powers()?;
        let mut table = Self {
            octaves,
            finer,
            across,
            middle: map.middle(),
            middle_image: map.middle_image(),
            rims: Vec::new(),
            cells: Vec::new(),
        };
        for column in 0..SECTORS * across {
            let slope = |t: f64| (column % across) as f64 * 2.0 / across as f64 - 1.0 + (t + 1.0) / across as f64;
            let direction = |t: f64| (column / across) as f64 * FRAC_PI_2 + slope(t).atan();
            let mut rims = [0.0; TERMS];
            for (rim, t) in rims.iter_mut().zip(nodes()) {
                *rim = map.rim(direction(t))?;
            }
            let rim = (powers * SMatrix::<f64, TERMS, 1>::from(rims)).into();
            table.rims.push(rim);
            for row in 0..table.along() {
                let [begin, length] = table.cell_along(row);
                let image = |t_along: f64, t_across: f64| {
                    let root = begin + 0.5 * (t_along + 1.0) * length;
                    let distance = (1.0 - root * root) * horner::<false>(&rim, t_across);
                    let (sin, cos) = direction(t_across).sin_cos();
                    let [u, v] = map.image([table.middle[0] + distance * cos, table.middle[1] + distance * sin])?;
                    let (x, y) = (u - table.middle_image[0], v - table.middle_image[1]);
                    Some([x * cos + y * sin, y * cos - x * sin])
                };
                let cell = cell(&powers, image);
                let tells = cell[0].is_finite();
                let is_right = !tells || is_near(&cell, image, map.tolerance());
                if !is_right && begin + length > ASKED {
                    return None;
                }
                table.cells.push(if is_right { cell } else { UNTOLD });
            }
        }
        Some(table)
    }

    /// Appends the images of places to `found`: [`ASK`] where the table does not tell, and not numbers outside the field.
    pub fn images(&self, places: &[[f64; 2]], best: bool, found: &mut Vec<[f64; 2]>) {
        if best {
            images_best(self, places, found);
        } else {
            self.images_of::<ALWAYS_FUSED>(places, found);
        }
    }

    #[inline(always)]
    fn images_of<const FUSED: bool>(&self, places: &[[f64; 2]], found: &mut Vec<[f64; 2]>) {
        found.reserve(places.len());
        for block in places.chunks(BLOCK) {
            let mut at = [[1.0, 0.0]; BLOCK];
            at[..block.len()].copy_from_slice(block);
            let images = self.block::<FUSED>(&at);
            found.extend_from_slice(&images[..block.len()]);
        }
    }

    #[inline(always)]
    fn block<const FUSED: bool>(&self, at: &[[f64; 2]; BLOCK]) -> [[f64; 2]; BLOCK] {
        let across = self.across as f64;
        let (mut slope, mut distance, mut column) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        let (mut cos, mut sin) = ([0.0; BLOCK], [0.0; BLOCK]);
        for j in 0..BLOCK {
            let (x, y) = (at[j][0] - self.middle[0], at[j][1] - self.middle[1]);
            let steep = y.abs() > x.abs();
            let (over, under) = (if steep { -x } else { y }, if steep { y } else { x });
            let under = if under == 0.0 { 1.0 } else { under };
            let sector = if steep { 1.0 } else { 0.0 } + if under < 0.0 { 2.0 } else { 0.0 };
            let place = (over / under + 1.0) * (0.5 * across);
            let cell = (place as i32 as f64).min(across - 1.0);
            slope[j] = 2.0 * (place - cell) - 1.0;
            column[j] = sector * across + cell;
            distance[j] = (x * x + y * y).sqrt();
            let over_distance = 1.0 / if distance[j] == 0.0 { 1.0 } else { distance[j] };
            (cos[j], sin[j]) = (x * over_distance, y * over_distance);
        }
        let (mut rim, mut part) = ([0.0; BLOCK], [0.0; BLOCK]);
        for j in 0..BLOCK {
            rim[j] = self.rims.get(column[j] as usize).map_or(f64::NAN, |rim| horner::<FUSED>(rim, slope[j]));
        }
        // The exponent and the first bits of the fraction of w number its cell.
        let (shift, innermost) = (52 - self.finer, self.innermost());
        let first = innermost.to_bits() >> shift;
        let of_octave = 1.0 / (1_u64 << self.finer) as f64;
        let (mut root, mut row) = ([0.0; BLOCK], [0_u64; BLOCK]);
        for j in 0..BLOCK {
            part[j] = distance[j] / rim[j];
            let left = 1.0 - part[j];
            // In the middle itself w would be in the octave after the last.
            let w = if left > 0.0 { left } else { 0.0 }.sqrt().min(1.0 - f64::EPSILON);
            let bits = w.to_bits();
            let is_inner = w < innermost;
            let begin = f64::from_bits((bits >> shift) << shift);
            // The length of a cell is the octave's, which is w without its fraction, over the number of its cells.
            let octave = f64::from_bits((bits >> 52) << 52);
            let length = if is_inner { innermost } else { octave * of_octave };
            root[j] = 2.0 * (w - if is_inner { 0.0 } else { begin }) / length - 1.0;
            row[j] = if is_inner { 0 } else { (bits >> shift) - first + 1 };
        }
        let (along, [u, v]) = (self.along(), self.middle_image);
        let mut images = [[f64::NAN; 2]; BLOCK];
        for j in 0..BLOCK {
            let cell = self.cells.get(column[j] as usize * along + (row[j] as usize).min(along - 1));
            images[j] = match cell {
                Some(cell) if part[j] < 1.0 - RIM => {
                    let [x, y] = evaluated::<FUSED>(cell, root[j], slope[j]);
                    let image = [u + x * cos[j] - y * sin[j], v + x * sin[j] + y * cos[j]];
                    if image[0].is_finite() { image } else { ASK }
                }
                _ if part[j] > 1.0 + RIM => [f64::NAN; 2],
                _ => ASK,
            };
        }
        images
    }
}

/// Where a table does not tell.
pub(super) const ASK: [f64; 2] = [f64::INFINITY; 2];

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn images_best(table: &PolarTable, places: &[[f64; 2]], found: &mut Vec<[f64; 2]>) {
    if target_cfg_f!(target_feature = "fma") {
        table.images_of::<true>(places, found);
    } else {
        table.images_of::<ALWAYS_FUSED>(places, found);
    }
}

/// Chebyshev's nodes.
fn nodes() -> [f64; TERMS] {
    std::array::from_fn(|i| (PI * (i as f64 + 0.5) / TERMS as f64).cos())
}

/// From values at the nodes to coefficients of powers.
fn to_powers() -> Option<Nodes> {
    let nodes = nodes();
    Nodes::from_fn(|node, power| nodes[node].powi(power as i32)).try_inverse()
}

/// The polynomial of a cell; [`UNTOLD`] where a node has no image.
fn cell(powers: &Nodes, image: impl Fn(f64, f64) -> Option<[f64; 2]>) -> Cell {
    let nodes = nodes();
    let mut values = [Nodes::zeros(); 2];
    for (i, j) in (0..TERMS * TERMS).map(|n| (n / TERMS, n % TERMS)) {
        let Some(at) = image(nodes[i], nodes[j]) else { return UNTOLD };
        (values[0][(i, j)], values[1][(i, j)]) = (at[0], at[1]);
    }
    let coefficients = values.map(|values| powers * values * powers.transpose());
    std::array::from_fn(|n| coefficients[n % 2][(n / ROW, n % ROW / 2)])
}

/// Whether the polynomial of a cell is near the image where polynomials through the nodes are worst: in the corners, and in the middle.
fn is_near(cell: &Cell, image: impl Fn(f64, f64) -> Option<[f64; 2]>, tolerance: f64) -> bool {
    const LOOKED_AT: [[f64; 2]; 5] = [[0.999, 0.999], [-0.999, 0.999], [0.999, -0.999], [-0.999, -0.999], [0.0, 0.0]];
    LOOKED_AT.into_iter().all(|[along, across]| {
        let [x, y] = evaluated::<false>(cell, along, across);
        image(along, across).is_none_or(|[u, v]| (x - u).hypot(y - v) <= tolerance)
    })
}

#[inline(always)]
fn horner<const FUSED: bool>(coefficients: &[f64; TERMS], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| multiply_add::<FUSED>(sum, t, *coefficient))
}

#[inline(always)]
fn evaluated<const FUSED: bool>(cell: &Cell, along: f64, across: f64) -> [f64; 2] {
    let mut sums = [0.0; ROW];
    let (rows, _) = cell.as_chunks::<ROW>();
    for row in rows.iter().rev() {
        for (sum, coefficient) in sums.iter_mut().zip(row) {
            *sum = multiply_add::<FUSED>(*sum, along, *coefficient);
        }
    }
    let (pairs, _) = sums.as_chunks::<2>();
    pairs.iter().rev().fold([0.0; 2], |[x, y], pair| {
        [multiply_add::<FUSED>(x, across, pair[0]), multiply_add::<FUSED>(y, across, pair[1])]
    })
}
