//! Which part of the corridor's floor was seen so far.

use nalgebra::Vector3;
use vergence_scene::CorridorPlan;
use vergence_vision::Point;

use super::Station;

/// Side of the cells in millimetres.
const CELL: f64 = 100.0;
/// Height of the places that are asked for: 50 mm above the floor, lower than any parcel.
const BESIDE_FLOOR: f64 = 100.0;

/// The free cells of a corridor, and which of them a camera saw.
pub struct AreaSeen {
    cells: Vec<([f64; 2], bool)>,
}

impl AreaSeen {
    /// Nothing is seen yet.
    pub fn of(plan: &CorridorPlan) -> Self {
        let steps = |from: f64, to: f64| {
            let count = ((to - from) / CELL).floor() as u32;
            (0..count).map(move |step| from + CELL * (f64::from(step) + 0.5))
        };
        let half = plan.half_width;
        let across = steps(-half, half).flat_map(|x| steps(plan.ends[0], plan.ends[1]).map(move |z| [x, z]));
        Self { cells: across.filter(|&cell| plan.is_free(cell)).map(|cell| (cell, false)).collect() }
    }

    /// Adds what one of the cameras of a station truly saw.
    pub fn add(&mut self, station: &Station) {
        for ([x, z], seen) in self.cells.iter_mut().filter(|(_, seen)| !seen) {
            *seen = station.sees(&Point::from_mm(Vector3::new(*x, BESIDE_FLOOR, *z)));
        }
    }

    /// The part of the free floor that was seen, 0 to 1.
    pub fn share(&self) -> f64 {
        self.cells.iter().filter(|(_, seen)| *seen).count() as f64 / self.cells.len().max(1) as f64
    }
}
