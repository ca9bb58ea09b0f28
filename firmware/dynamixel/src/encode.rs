//! Packets that a master sends.

use crate::builder::{Builder, Encoded, Full};
use crate::id::Id;
use crate::instruction::{BulkItem, CLEAR_TURNS, InstructionCode, ResetScope};

/// Asks whether the servo, or with [`Id::BROADCAST`] any servo, is there.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn ping(id: Id) -> Result<Encoded, Full> {
    with(id, InstructionCode::Ping, &[])
}

/// Reads `length` bytes.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn read(id: Id, address: u16, length: u16) -> Result<Encoded, Full> {
    let mut packet = Builder::new(id, InstructionCode::Read as u8)?;
    packet.word(address)?;
    packet.word(length)?;
    packet.finish()
}

/// Writes `data`.
///
/// # Errors
/// [`Full`], if the data do not fit into a packet.
pub fn write(id: Id, address: u16, data: &[u8]) -> Result<Encoded, Full> {
    addressed(id, InstructionCode::Write, address, data)
}

/// Writes `data` at the next [`action`].
///
/// # Errors
/// [`Full`], if the data do not fit into a packet.
pub fn reg_write(id: Id, address: u16, data: &[u8]) -> Result<Encoded, Full> {
    addressed(id, InstructionCode::RegWrite, address, data)
}

/// Carries out the write that waits.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn action(id: Id) -> Result<Encoded, Full> {
    with(id, InstructionCode::Action, &[])
}

/// Sets the servo back to the values of the factory.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn factory_reset(id: Id, scope: ResetScope) -> Result<Encoded, Full> {
    with(id, InstructionCode::FactoryReset, &[scope as u8])
}

/// Starts the servo anew, which clears its hardware errors.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn reboot(id: Id) -> Result<Encoded, Full> {
    with(id, InstructionCode::Reboot, &[])
}

/// Forgets whole turns of the position. The servo must stand.
///
/// # Errors
/// [`Full`] never; as for the other packets.
pub fn clear_turns(id: Id) -> Result<Encoded, Full> {
    with(id, InstructionCode::Clear, &CLEAR_TURNS)
}

/// Reads the same `length` bytes of several servos, which answer one after the other.
///
/// # Errors
/// [`Full`], if there are too many servos for a packet.
pub fn sync_read(address: u16, length: u16, ids: &[Id]) -> Result<Encoded, Full> {
    reads(InstructionCode::SyncRead, address, length, ids)
}

/// As [`sync_read`]; all answer in one packet: [`crate::FastBlocks`].
///
/// # Errors
/// [`Full`], if there are too many servos for a packet.
pub fn fast_sync_read(address: u16, length: u16, ids: &[Id]) -> Result<Encoded, Full> {
    reads(InstructionCode::FastSyncRead, address, length, ids)
}

/// Writes `N` bytes to each of several servos.
///
/// # Errors
/// [`Full`], if they do not fit into a packet.
pub fn sync_write<const N: usize>(address: u16, items: &[(Id, [u8; N])]) -> Result<Encoded, Full> {
    let mut packet = Builder::new(Id::BROADCAST, InstructionCode::SyncWrite as u8)?;
    packet.word(address)?;
    packet.word(u16::try_from(N).map_err(|_| Full)?)?;
    for (id, data) in items {
        packet.push(id.get())?;
        packet.extend(data)?;
    }
    packet.finish()
}

/// Reads different registers of several servos, which answer one after the other. The items carry no data.
///
/// # Errors
/// [`Full`], if there are too many servos for a packet.
pub fn bulk_read(items: &[BulkItem<'_>]) -> Result<Encoded, Full> {
    bulk(InstructionCode::BulkRead, items)
}

/// As [`bulk_read`]; all answer in one packet: [`crate::FastBlocks`].
///
/// # Errors
/// [`Full`], if there are too many servos for a packet.
pub fn fast_bulk_read(items: &[BulkItem<'_>]) -> Result<Encoded, Full> {
    bulk(InstructionCode::FastBulkRead, items)
}

/// Writes different registers of several servos; the length on the wire is that of each item's data.
///
/// # Errors
/// [`Full`], if they do not fit into a packet.
pub fn bulk_write(items: &[BulkItem<'_>]) -> Result<Encoded, Full> {
    bulk(InstructionCode::BulkWrite, items)
}

/// A packet with any instruction byte and parameters, for tests of what servos and masters make of them.
///
/// # Errors
/// [`Full`], if the parameters do not fit into a packet.
pub fn raw(id: Id, instruction: u8, parameters: &[u8]) -> Result<Encoded, Full> {
    let mut packet = Builder::new(id, instruction)?;
    packet.extend(parameters)?;
    packet.finish()
}

fn with(id: Id, code: InstructionCode, parameters: &[u8]) -> Result<Encoded, Full> {
    raw(id, code as u8, parameters)
}

fn addressed(id: Id, code: InstructionCode, address: u16, data: &[u8]) -> Result<Encoded, Full> {
    let mut packet = Builder::new(id, code as u8)?;
    packet.word(address)?;
    packet.extend(data)?;
    packet.finish()
}

fn reads(code: InstructionCode, address: u16, length: u16, ids: &[Id]) -> Result<Encoded, Full> {
    let mut packet = Builder::new(Id::BROADCAST, code as u8)?;
    packet.word(address)?;
    packet.word(length)?;
    ids.iter().try_for_each(|id| packet.push(id.get()))?;
    packet.finish()
}

fn bulk(code: InstructionCode, items: &[BulkItem<'_>]) -> Result<Encoded, Full> {
    let writes = code == InstructionCode::BulkWrite;
    let mut packet = Builder::new(Id::BROADCAST, code as u8)?;
    for item in items {
        packet.push(item.id)?;
        packet.word(item.address)?;
        if writes {
            packet.word(u16::try_from(item.data.len()).map_err(|_| Full)?)?;
            packet.extend(item.data)?;
        } else {
            packet.word(item.length)?;
        }
    }
    packet.finish()
}
