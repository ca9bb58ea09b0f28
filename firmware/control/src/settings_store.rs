//! Settings in flash: two pages are written in turn, so that one complete record exists at every instant.
//!
//! A record is `magic | sequence | length | body | CRC-32C`, little-endian, filled up with 0xFF to whole units; the body
//! is a list of item, axis and value (postcard). The newest record with a correct CRC counts. Saving erases and writes the
//! other page, the CRC last: a power cut at any point leaves the old record untouched. The record holds item numbers
//! instead of a struct, so that firmware of another version can read the items that it knows.

use vergence_protocol::frame::checksum;
use vergence_protocol::{SettingItem, SettingKey};

use crate::board_settings::{BoardSettings, Delivered, Machine};
use crate::services::{Flash, FlashError, PAGE, UNIT};

const MAGIC: [u8; 4] = *b"VGS1";
const HEADER: usize = 12;
const CRC: usize = 4;
const MAX_BODY: usize = PAGE - HEADER - CRC;
/// The two pages.
const PAGES: [usize; 2] = [0, 1];

type Page = [u8; PAGE];

/// A complete record holds settings that this firmware refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the saved settings are refused by this firmware")]
pub struct SettingsRefused;

/// Reads the settings last saved; `None` if none were saved. Items that the record does not hold are taken from `delivered`, for
/// the machine that the record names.
///
/// # Errors
/// [`SettingsRefused`] if the board cannot work with what was saved.
pub fn load(flash: &mut impl Flash, delivered: &Delivered) -> Result<Option<BoardSettings>, SettingsRefused> {
    let mut page = [0; PAGE];
    let newest = newest(flash, &mut page);
    let Some(record) = newest.and_then(|(newest, _)| read_record(flash, newest, &mut page)) else { return Ok(None) };
    let settings = decode(record.body, delivered).ok_or(SettingsRefused)?;
    settings.validate().map_err(|_| SettingsRefused)?;
    if settings.machine == settings.machine_of_axes() { Ok(Some(settings)) } else { Err(SettingsRefused) }
}

/// Saves `settings` and reads them back.
///
/// # Errors
/// [`FlashError`] if the flash failed; the settings saved before are still there.
pub fn save(flash: &mut impl Flash, settings: &BoardSettings) -> Result<(), FlashError> {
    let mut page = [0xFF; PAGE];
    let (other, sequence) = match newest(flash, &mut page) {
        Some((newest, sequence)) => (1 - newest, sequence.wrapping_add(1)),
        None => (0, 0),
    };
    page.fill(0xFF);
    let length = encode(settings, sequence, &mut page).ok_or(FlashError)?;
    flash.erase(other)?;
    let (units, _) = page[..length.next_multiple_of(UNIT)].as_chunks::<UNIT>();
    for (index, unit) in units.iter().enumerate() {
        flash.program(other * PAGE + index * UNIT, *unit)?;
    }
    match read_record(flash, other, &mut page) {
        Some(record) if record.sequence == sequence => Ok(()),
        _ => Err(FlashError),
    }
}

struct Record<'a> {
    sequence: u32,
    body: &'a [u8],
}

/// The page with the newest complete record, and the record's sequence number.
fn newest(flash: &mut impl Flash, page: &mut Page) -> Option<(usize, u32)> {
    let [first, second] = PAGES.map(|index| read_record(flash, index, page).map(|record| (index, record.sequence)));
    match (first, second) {
        // Sequence numbers wrap: up to half the range ahead counts as newer.
        (Some(first), Some(second)) => Some(if second.1.wrapping_sub(first.1) < 1 << 31 { second } else { first }),
        (first, second) => first.or(second),
    }
}

fn read_record<'a>(flash: &mut impl Flash, index: usize, page: &'a mut Page) -> Option<Record<'a>> {
    flash.read(index * PAGE, page).ok()?;
    let (magic, rest) = page.split_first_chunk::<4>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    let (length, rest) = rest.split_first_chunk::<4>()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    if *magic != MAGIC || length > MAX_BODY {
        return None;
    }
    let (body, rest) = rest.split_at(length);
    let crc = u32::from_le_bytes(*rest.first_chunk::<CRC>()?);
    let holds = checksum(&page[..HEADER + length]) == crc;
    holds.then_some(Record { sequence: u32::from_le_bytes(*sequence), body })
}

/// Writes a record to the start of `page`; returns its length in bytes.
fn encode(settings: &BoardSettings, sequence: u32, page: &mut Page) -> Option<usize> {
    let mut end = HEADER;
    for key in settings.keys() {
        let entry = (key, settings.get(key)?);
        end += postcard::to_slice(&entry, &mut page[end..PAGE - CRC]).ok()?.len();
    }
    let length = u32::try_from(end - HEADER).ok()?;
    page[..4].copy_from_slice(&MAGIC);
    page[4..8].copy_from_slice(&sequence.to_le_bytes());
    page[8..HEADER].copy_from_slice(&length.to_le_bytes());
    let crc = checksum(&page[..end]);
    page[end..end + CRC].copy_from_slice(&crc.to_le_bytes());
    Some(end + CRC)
}

/// Reads the items that this firmware knows; `None` if the body is no list of settings.
fn decode(body: &[u8], delivered: &Delivered) -> Option<BoardSettings> {
    let mut machine = Machine::Bench;
    read(body, |key, value| {
        if key.item == SettingItem::Machine && value == Machine::Robot as i64 {
            machine = Machine::Robot;
        }
    })?;
    let mut settings = delivered.of(machine).clone();
    // An axis that the board no longer has is ignored as well.
    read(body, |key, value| {
        let _ = settings.put(key, value);
    })?;
    Some(settings)
}

fn read(mut body: &[u8], mut take: impl FnMut(SettingKey, i64)) -> Option<()> {
    while !body.is_empty() {
        // The item by its number: newer firmware may have saved items that this one does not know.
        let ((item, axis, value), rest) = postcard::take_from_bytes::<(u32, u8, i64)>(body).ok()?;
        body = rest;
        if let Some(&item) = SettingItem::ALL.get(item as usize) {
            take(SettingKey { item, axis }, value);
        }
    }
    Some(())
}
