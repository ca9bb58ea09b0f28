//! Sums of the products of every two numbers of a row, over many rows.
//!
//! Rows wait until there are some, and are then summed square by square of the result, which stays in the registers of the processor. Each sum
//! takes its rows in their order, so that it is the same number whatever the instructions and however many rows wait.

use multiversion::multiversion;

/// Side of a square.
const SIDE: usize = 4;
/// Rows that wait at most.
const WAITING: usize = 32;

/// The sums.
pub(super) struct Products {
    /// Numbers of a row, with zeros up to whole squares.
    width: usize,
    /// Row by row, of which the squares on the diagonal and right of it are made.
    sums: Vec<f64>,
    waiting: Vec<f64>,
}

impl Products {
    /// Of rows of so many numbers.
    pub fn new(numbers: usize) -> Self {
        let width = numbers.next_multiple_of(SIDE);
        Self { width, sums: vec![0.0; width * width], waiting: Vec::with_capacity(WAITING * width) }
    }

    /// A new row of zeros, to be filled.
    pub fn row(&mut self) -> &mut [f64] {
        if self.waiting.len() >= WAITING * self.width {
            self.sum();
        }
        let start = self.waiting.len();
        self.waiting.resize(start + self.width, 0.0);
        &mut self.waiting[start..]
    }

    /// Adds the rows that wait, without which [`Self::at`] is not complete.
    pub fn sum(&mut self) {
        add(self.width, &self.waiting, &mut self.sums);
        self.waiting.clear();
    }

    /// The sum of the products of two numbers.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.sums[i.min(j) * self.width + i.max(j)]
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn add(width: usize, rows: &[f64], sums: &mut [f64]) {
    for top in (0..width).step_by(SIDE) {
        for left in (top..width).step_by(SIDE) {
            let mut square = [[0.0; SIDE]; SIDE];
            for (line, sums) in square.iter_mut().zip(sums[top * width..].chunks_exact(width)) {
                line.copy_from_slice(&sums[left..left + SIDE]);
            }
            for row in rows.chunks_exact(width) {
                let (Some(down), Some(across)) = (row[top..].first_chunk::<SIDE>(), row[left..].first_chunk::<SIDE>())
                else {
                    continue;
                };
                for i in 0..SIDE {
                    for j in 0..SIDE {
                        square[i][j] += down[i] * across[j];
                    }
                }
            }
            for (line, sums) in square.iter().zip(sums[top * width..].chunks_exact_mut(width)) {
                sums[left..left + SIDE].copy_from_slice(line);
            }
        }
    }
}
