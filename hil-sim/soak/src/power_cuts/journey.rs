//! What a board does while the power is cut: updates, ways back, settings that are saved.

use vergence_image::layout::{IMAGE, PAGE};
use vergence_mcu::{Firmware, FlashCells};
use vergence_protocol::management::BootState;

use super::image::SignedImage;
use super::sweep::Ending;
use super::talk::Talk;

/// What is done while the power is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Journey {
    /// The old image takes the new one, which is confirmed.
    Update,
    /// The new image is not confirmed, and the next start goes back.
    GoingBack,
    /// A confirmed image is given up for the one before it.
    Rollback,
    /// No image is sound; the boot loader's recovery takes one, which is confirmed.
    Recovery,
    /// Settings are saved twice, one time into each page.
    Settings,
}

impl Journey {
    /// Every journey.
    pub const ALL: [Self; 5] = [Self::Update, Self::GoingBack, Self::Rollback, Self::Recovery, Self::Settings];

    /// Its name for the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Update => "update",
            Self::GoingBack => "going-back",
            Self::Rollback => "rollback",
            Self::Recovery => "recovery",
            Self::Settings => "settings",
        }
    }

    /// What is done, for a sentence.
    #[must_use]
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Update => "an update",
            Self::GoingBack => "an update that is not confirmed and taken back",
            Self::Rollback => "a rollback",
            Self::Recovery => "an update through the recovery",
            Self::Settings => "two savings of settings",
        }
    }
}

/// A journey with its images.
pub(super) struct Course {
    pub journey: Journey,
    /// The image before the journey; in a recovery, one that is sent afterwards.
    old: SignedImage,
    /// The image to which the journey leads or tries to lead.
    new: SignedImage,
    /// Flash before the journey.
    pub before: FlashCells,
    /// Flash operations of the first of two savings.
    first_saving: usize,
}

impl Course {
    /// Prepares a board that was delivered with the first image.
    pub fn prepare(journey: Journey, boot_loader: &Firmware, [old, new]: [SignedImage; 2]) -> Result<Self, String> {
        let delivered = old.delivered_with(boot_loader).ok_or("boot loader and application do not fit into flash")?;
        let course = |old, new, before| Self { journey, old, new, before, first_saving: 0 };
        Ok(match journey {
            Journey::Update | Journey::GoingBack => course(old, new, delivered),
            Journey::Rollback => {
                let mut talk = Talk::switched_on(&delivered);
                talk.update(&new)?;
                let before = talk.machine().chip().flash_cells();
                course(new, old, before)
            }
            Journey::Recovery => {
                let mut before = delivered;
                before.load((IMAGE.start + 7 * PAGE) as usize, b"neither image");
                course(old, new, before)
            }
            Journey::Settings => {
                let mut talk = Talk::switched_on(&delivered);
                talk.open()?;
                talk.save(0)?;
                let before = talk.machine().chip().flash_cells();
                course(old, new, before)
            }
        })
    }

    /// Makes the journey, without a cut.
    pub fn travel(&mut self, talk: &mut Talk) -> Result<(), String> {
        let last = match self.journey {
            Journey::Update | Journey::Recovery => talk.update(&self.new).map(|()| &self.new),
            Journey::GoingBack => talk.try_and_go_back(&self.new).map(|()| &self.old),
            Journey::Rollback => talk.roll_back(&self.new).map(|()| &self.new),
            Journey::Settings => {
                talk.open()?;
                talk.save(1)?;
                self.first_saving = talk.operations.len();
                talk.save(2).map(|()| &self.old)
            }
        }?;
        let holds = last.is_installed(&talk.machine().chip().flash_cells());
        if holds { Ok(()) } else { Err("without a cut the flash does not hold the image that it should".into()) }
    }

    /// The state of a board after the cut at this operation.
    pub fn judge(&self, talk: &mut Talk, operation: usize) -> Result<Ending, String> {
        let identity = talk.identify()?;
        if identity.boot == BootState::Recovery {
            return Ok(Ending::Recovery);
        }
        let cells = talk.machine().chip().flash_cells();
        let runs = |image: &SignedImage| image.is_installed(&cells) && identity.build == image.seal.header.build;
        if self.journey == Journey::Settings && runs(&self.old) {
            return self.judge_settings(talk, operation);
        }
        match () {
            () if runs(&self.old) => Ok(Ending::Old),
            () if runs(&self.new) => Ok(Ending::New),
            () => Err(format!("what runs is neither image: {identity:?}")),
        }
    }

    /// Which saving the settings are from: the one that was cut, or the one before.
    fn judge_settings(&self, talk: &mut Talk, operation: usize) -> Result<Ending, String> {
        talk.open()?;
        let before = i64::from(operation >= self.first_saving);
        match talk.saved()? {
            saved if saved == before => Ok(Ending::Old),
            saved if saved == before + 1 => Ok(Ending::New),
            saved => Err(format!("the settings are those of saving {saved}, not {before} or the next")),
        }
    }

    /// Tries it once more on a board whose state is known.
    pub fn try_again(&self, talk: &mut Talk, ending: &Ending) -> Result<(), String> {
        if self.journey == Journey::Settings {
            talk.save(3)?;
            let mut after = Talk::switched_on(&talk.machine().chip().flash_cells());
            after.open()?;
            let saved = after.saved()?;
            return if saved == 3 { Ok(()) } else { Err(format!("after saving 3 the settings are those of {saved}")) };
        }
        let image = if *ending == Ending::Old { &self.new } else { &self.old };
        if self.journey == Journey::Rollback && *ending == Ending::Old {
            talk.roll_back(image)?;
        } else {
            talk.update(image)?;
        }
        let holds = image.is_installed(&talk.machine().chip().flash_cells());
        if holds { Ok(()) } else { Err("the flash does not hold the image".into()) }
    }
}
