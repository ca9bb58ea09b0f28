//! The sweep: power cuts at one flash operation after the other.

use std::ops::Range;

use rayon::prelude::*;
use vergence_image::layout::{PAGE, STATE};
use vergence_mcu::{Damage, Firmware, FlashCells, FlashOperation};

use super::image::SignedImage;
use super::journey::{Course, Journey};
use super::known::KnownStarts;
use super::talk::Talk;
use super::tally::CutTally;

/// Number of cuts after which a second attempt is made.
const AGAIN_EVERY: usize = 97;

/// State of a board after the power has returned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It runs the image from before, or has the settings from before.
    Old,
    /// It runs the new image, or has the new settings.
    New,
    /// The boot loader waits for an image.
    Recovery,
    /// The board does none of these, or a second attempt fails.
    Bricked(String),
}

/// A cut and its outcome.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Number of the cut.
    pub number: usize,
    /// The operation that was cut, counted from zero.
    pub operation: usize,
    /// State of the board afterwards.
    pub ending: Ending,
    /// Whether the start was made; otherwise it equals one that was.
    pub started: bool,
    /// Whether a second attempt was made afterwards.
    pub updated: bool,
}

/// A journey, and the cuts that are made in it.
///
/// Cuts are an endless sequence: first at every erasure, then at every word of the swap's state, then at all others,
/// spread over the journey from the first on; then the same with other damage.
pub struct Sweep {
    course: Course,
    operations: Vec<FlashOperation>,
    /// Operations in the order in which they are cut.
    order: Vec<usize>,
    known: KnownStarts,
}

impl Sweep {
    /// Runs a journey without cuts. The board is delivered with the first image; the second is the one that is sent.
    ///
    /// # Errors
    /// Says why the journey does not work.
    pub fn new(boot_loader: &Firmware, images: [SignedImage; 2], journey: Journey) -> Result<Self, String> {
        let mut course = Course::prepare(journey, boot_loader, images)?;
        let mut talk = Talk::switched_on(&course.before);
        talk.list_operations();
        course.travel(&mut talk)?;
        let operations = std::mem::take(&mut talk.operations);
        let order = order(&operations);
        Ok(Self { course, operations, order, known: KnownStarts::default() })
    }

    /// The journey.
    #[must_use]
    pub fn journey(&self) -> Journey {
        self.course.journey
    }

    /// The flash operations of the journey without a cut.
    #[must_use]
    pub fn operations(&self) -> &[FlashOperation] {
        &self.operations
    }

    /// How many of the cuts are at erasures, and how many at erasures and words of the swap's state.
    #[must_use]
    pub fn critical(&self) -> [usize; 2] {
        [0, 1].map(|last| self.operations.iter().filter(|&&operation| rank(operation) <= last).count())
    }

    /// Makes cuts in parallel.
    #[must_use]
    pub fn cut(&self, numbers: Range<usize>) -> Vec<Cut> {
        numbers.into_par_iter().map(|number| self.cut_one(number, number.is_multiple_of(AGAIN_EVERY))).collect()
    }

    /// Makes a cut. A board on which it is to be tried `again` is started even if an equal start is known.
    #[must_use]
    pub fn cut_one(&self, number: usize, again: bool) -> Cut {
        let operation = self.order[number % self.order.len()];
        let cells = self.remains(number);
        let digests = cells.page_digests();
        if !again && let Some(ending) = self.known.find(&digests) {
            return Cut { number, operation, ending, started: false, updated: false };
        }
        let (ending, pages, mut talk) = self.start(&cells, operation);
        self.known.remember(&pages, &digests, &ending);
        let mut cut = Cut { number, operation, ending, started: true, updated: false };
        if again && !matches!(cut.ending, Ending::Bricked(_)) || cut.ending == Ending::Recovery {
            match self.course.try_again(&mut talk, &cut.ending) {
                Ok(()) => cut.updated = true,
                Err(problem) => cut.ending = Ending::Bricked(format!("a second attempt fails: {problem}")),
            }
        }
        cut
    }

    /// The contents of flash after a cut.
    #[must_use]
    pub fn remains(&self, number: usize) -> FlashCells {
        let cut = self.order[number % self.order.len()];
        let mut cells = self.course.before.clone();
        for &operation in &self.operations[..cut] {
            cells.operate(operation, Damage::Complete);
        }
        cells.operate(self.operations[cut], Damage::Torn { seed: number as u64 });
        cells
    }

    /// Starts a board with this flash, where this operation was cut; returns the outcome and the pages that affected it.
    fn start(&self, cells: &FlashCells, operation: usize) -> (Ending, Vec<usize>, Talk) {
        let mut talk = Talk::switched_on(cells);
        let ending = self.course.judge(&mut talk, operation).unwrap_or_else(Ending::Bricked);
        (ending, talk.machine().pages_used(), talk)
    }

    /// Counts cuts.
    #[must_use]
    pub fn tally(&self, cuts: &[Cut]) -> CutTally {
        let mut tally = CutTally::default();
        cuts.iter().for_each(|cut| tally.add(cut, self.operations[cut.operation]));
        tally
    }
}

/// Sorts operations: erasures, words of the state, others.
pub(super) fn rank(operation: FlashOperation) -> usize {
    match operation {
        FlashOperation::Program { offset, .. } if (STATE.start..STATE.end()).contains(&offset) => 1,
        FlashOperation::Program { .. } => 2,
        _ => 0,
    }
}

/// The order in which operations are cut. The others come in strides, so that any first part of them covers the journey.
fn order(operations: &[FlashOperation]) -> Vec<usize> {
    let of_rank = |wanted| (0..operations.len()).filter(move |&index| rank(operations[index]) == wanted);
    let others: Vec<usize> = of_rank(2).collect();
    // A stride without a common divisor reaches every one.
    let stride = (PAGE as usize..).find(|&stride| greatest_common_divisor(stride, others.len()) == 1).unwrap_or(1);
    let spread = (0..others.len()).map(|index| others[index * stride % others.len()]);
    of_rank(0).chain(of_rank(1)).chain(spread).collect()
}

const fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}
