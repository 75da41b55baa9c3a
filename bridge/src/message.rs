//! What every message of a bridge begins with, and why one is not used.

use shm_types::SCHEMA;
use shm_types::command::CommandError;
use shm_types::episode::EpisodeError;
use shm_types::policy::PolicyMsgError;
use thiserror::Error;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Read as another number on a machine of the other byte order.
const MAGIC: u64 = u64::from_le_bytes(*b"SKBRIDGE");
/// The version of turns and answers. Message layouts have a hash of their own, [`SCHEMA`].
pub const VERSION: u64 = 3;

/// What every message begins with.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Prefix {
    pub magic: u64,
    pub version: u64,
    pub schema: u64,
}

/// Why a message of the other side is not used.
#[derive(Debug, Error, PartialEq)]
pub enum MessageError {
    #[error("not a bridge message, or from a machine with the other byte order")]
    Magic,
    #[error(
        "bridge version {found} instead of {VERSION}: use one version of skillet on both machines"
    )]
    Version { found: u64 },
    #[error(
        "schema {found:#x} instead of {SCHEMA:#x}: the two machines run different builds of skillet; use one"
    )]
    Schema { found: u64 },
    #[error("message of the wrong length ({len} bytes)")]
    Length { len: usize },
    #[error("a name or a reason in it is not valid text")]
    Text,
    #[error("its {0} is out of range")]
    Value(&'static str),
    #[error(transparent)]
    Command(#[from] CommandError),
    #[error(transparent)]
    Episode(#[from] EpisodeError),
    #[error(transparent)]
    Policy(#[from] PolicyMsgError),
}

impl Prefix {
    pub const OURS: Prefix = Prefix { magic: MAGIC, version: VERSION, schema: SCHEMA };

    /// Takes the prefix off `bytes`, after a look at the version before everything else.
    pub fn take(bytes: &[u8]) -> Result<&[u8], MessageError> {
        let (prefix, rest) = Prefix::read_from_prefix(bytes).map_err(|_| MessageError::Magic)?;
        match prefix {
            Prefix { magic, .. } if magic != MAGIC => Err(MessageError::Magic),
            Prefix { version, .. } if version != VERSION => {
                Err(MessageError::Version { found: version })
            }
            Prefix { schema, .. } if schema != SCHEMA => {
                Err(MessageError::Schema { found: schema })
            }
            _ => Ok(rest),
        }
    }
}
