//! The sweep: power cuts at one flash operation after the other.

use std::ops::Range;

use rayon::prelude::*;
use vergence_image::layout::{PAGE, STATE};
use vergence_mcu::{Damage, Firmware, FlashCells, FlashOperation};
use vergence_protocol::management::BootState;

use super::image::SignedImage;
use super::known::KnownStarts;
use super::talk::Talk;
use super::tally::CutTally;

/// Number of cuts after which a board is updated once more.
const AGAIN_EVERY: usize = 97;

/// The update in which cuts are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Journey {
    /// The old image takes the new one, which is confirmed.
    Update,
    /// The new image is not confirmed, and the next start goes back.
    GoingBack,
}

/// State of a board after the power has returned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It runs the image from before the update.
    Old,
    /// It runs the new image.
    New,
    /// The boot loader waits for an image.
    Recovery,
    /// The board does none of these, or takes no update.
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
    /// Whether a whole update was made afterwards.
    pub updated: bool,
}

/// An update, and the cuts that are made in it.
///
/// Cuts are an endless sequence: first at every erasure, then at every word of the swap's state, then at all others,
/// spread over the update from the first on; then the same with other damage.
pub struct Sweep {
    old: SignedImage,
    new: SignedImage,
    before: FlashCells,
    operations: Vec<FlashOperation>,
    /// Operations in the order in which they are cut.
    order: Vec<usize>,
    known: KnownStarts,
}

impl Sweep {
    /// Runs an update from `old` to `new` without cuts.
    ///
    /// # Errors
    /// Says why the update does not work.
    pub fn new(boot_loader: &Firmware, [old, new]: [SignedImage; 2], journey: Journey) -> Result<Self, String> {
        let before = old.delivered_with(boot_loader).ok_or("boot loader and application do not fit into flash")?;
        let mut talk = Talk::switched_on(&before);
        talk.list_operations();
        let last = match journey {
            Journey::Update => talk.update(&new).map(|()| &new),
            Journey::GoingBack => talk.try_and_go_back(&new).map(|()| &old),
        }?;
        if !last.is_installed(&talk.machine().chip().flash_cells()) {
            return Err("without a cut the flash does not hold the image that it should".into());
        }
        let operations = std::mem::take(&mut talk.operations);
        let order = order(&operations);
        Ok(Self { old, new, before, operations, order, known: KnownStarts::default() })
    }

    /// The flash operations of the update without a cut.
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

    /// Makes a cut. A board that is to be updated `again` is started even if an equal start is known.
    #[must_use]
    pub fn cut_one(&self, number: usize, again: bool) -> Cut {
        let operation = self.order[number % self.order.len()];
        let cells = self.remains(number);
        let digests = cells.page_digests();
        if !again && let Some(ending) = self.known.find(&digests) {
            return Cut { number, operation, ending, started: false, updated: false };
        }
        let (ending, pages, mut talk) = self.start(&cells);
        self.known.remember(&pages, &digests, &ending);
        let mut cut = Cut { number, operation, ending, started: true, updated: false };
        if again && !matches!(cut.ending, Ending::Bricked(_)) || cut.ending == Ending::Recovery {
            match self.update_again(&mut talk, &cut.ending) {
                Ok(()) => cut.updated = true,
                Err(problem) => cut.ending = Ending::Bricked(format!("no update after the cut: {problem}")),
            }
        }
        cut
    }

    /// The contents of flash after a cut.
    #[must_use]
    pub fn remains(&self, number: usize) -> FlashCells {
        let cut = self.order[number % self.order.len()];
        let mut cells = self.before.clone();
        for &operation in &self.operations[..cut] {
            cells.operate(operation, Damage::Complete);
        }
        cells.operate(self.operations[cut], Damage::Torn { seed: number as u64 });
        cells
    }

    /// Starts a board with this flash; returns the outcome and the pages that affected it.
    fn start(&self, cells: &FlashCells) -> (Ending, Vec<usize>, Talk) {
        let mut talk = Talk::switched_on(cells);
        let ending = self.judge(&mut talk).unwrap_or_else(Ending::Bricked);
        (ending, talk.machine().pages_used(), talk)
    }

    fn judge(&self, talk: &mut Talk) -> Result<Ending, String> {
        let identity = talk.identify()?;
        if identity.boot == BootState::Recovery {
            return Ok(Ending::Recovery);
        }
        let cells = talk.machine().chip().flash_cells();
        for (image, ending) in [(&self.old, Ending::Old), (&self.new, Ending::New)] {
            if image.is_installed(&cells) && identity.build == image.seal.header.build {
                return Ok(ending);
            }
        }
        Err(format!("what runs is neither image: {identity:?}"))
    }

    /// Updates the board to the image that it does not run.
    fn update_again(&self, talk: &mut Talk, ending: &Ending) -> Result<(), String> {
        let image = if *ending == Ending::Old { &self.new } else { &self.old };
        talk.update(image)?;
        let holds = image.is_installed(&talk.machine().chip().flash_cells());
        if holds { Ok(()) } else { Err("the flash does not hold the image".into()) }
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

/// The order in which operations are cut. The others come in strides, so that any first part of them covers the update.
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
