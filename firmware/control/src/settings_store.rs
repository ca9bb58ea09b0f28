//! Settings in flash: two pages in turn, so that one whole record is there at every instant.
//!
//! A record is `magic | sequence | length | body | CRC-32C`, little-endian, filled up with 0xFF to whole units; the body
//! is a list of item, axis and value (postcard). The newest record whose CRC holds is the one that counts. Saving
//! erases and writes the other page, the CRC last: wherever that is cut, the old record is untouched. Items by number
//! rather than a struct, so that firmware of another version takes from a record what it knows.

use vergence_protocol::frame::checksum;
use vergence_protocol::{SettingItem, SettingKey};

use crate::board_settings::BoardSettings;
use crate::flash::{Flash, FlashError, PAGE, UNIT};

const MAGIC: [u8; 4] = *b"VGS1";
const HEADER: usize = 12;
const CRC: usize = 4;
const MAX_BODY: usize = PAGE - HEADER - CRC;
/// The two pages.
const PAGES: [usize; 2] = [0, 1];

type Page = [u8; PAGE];

/// The settings last saved; `None` where there are none that this board can work with. What the record does not name
/// is as in `defaults`.
pub fn load(flash: &mut impl Flash, defaults: &BoardSettings) -> Option<BoardSettings> {
    let mut page = [0; PAGE];
    let (newest, _) = newest(flash, &mut page)?;
    let body = read_record(flash, newest, &mut page)?.body;
    let settings = decode(body, defaults)?;
    settings.validate().is_ok().then_some(settings)
}

/// Keeps `settings`; they are read back before they count as kept.
///
/// # Errors
/// [`FlashError`]: what was saved before is still there.
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

/// Which page holds the newest whole record, and its sequence number.
fn newest(flash: &mut impl Flash, page: &mut Page) -> Option<(usize, u32)> {
    let [first, second] = PAGES.map(|index| read_record(flash, index, page).map(|record| (index, record.sequence)));
    match (first, second) {
        // Numbers go round: half the range ahead is newer.
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

/// Writes a record to the start of `page`; returns its length.
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

/// Takes what this board knows; `None` where the body is no list of settings.
fn decode(mut body: &[u8], defaults: &BoardSettings) -> Option<BoardSettings> {
    let mut settings = defaults.clone();
    while !body.is_empty() {
        // The item by its number: newer firmware may have saved items that this one does not know.
        let ((item, axis, value), rest) = postcard::take_from_bytes::<(u32, u8, i64)>(body).ok()?;
        body = rest;
        if let Some(&item) = SettingItem::ALL.get(item as usize) {
            // Neither does it matter if the board once had more axes.
            let _ = settings.put(SettingKey { item, axis }, value);
        }
    }
    Some(settings)
}
