//! Session ids.

use vergence_protocol::SessionId;

use super::error::OpenError;

/// A random session id, never zero: no other connection has it.
///
/// # Errors
/// [`OpenError::Random`] where the operating system has no randomness to give.
pub fn fresh_session() -> Result<SessionId, OpenError> {
    use rand::TryRng;
    let random = rand::rngs::SysRng.try_next_u32().map_err(|error| OpenError::Random(error.to_string()))?;
    Ok(SessionId(random.max(1)))
}
