//! Certificates for a bridge: an authority of its own, one certificate for the learner's machine, one for every cell.
//!
//! ```text
//! DIR/ca.pem, DIR/ca.key                     the authority; its key stays with those who add cells
//! DIR/learner/{ca,cert,key}.pem              for the hub
//! DIR/cells/<cell>/{ca,cert,key}.pem         for that cell
//! ```

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write};
use std::net::IpAddr;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose, SanType,
};
use shm_types::cell::{Cell, CellError};
use thiserror::Error;
use time::{Duration, OffsetDateTime};
use x509_parser::pem::parse_x509_pem;

/// Files in the folder of a machine.
pub const AUTHORITY: &str = "ca.pem";
pub const CERTIFICATE: &str = "cert.pem";
pub const KEY: &str = "key.pem";
/// The authority's own key.
const AUTHORITY_KEY: &str = "ca.key";
const LEARNER: &str = "learner";
const CELLS: &str = "cells";

/// Certificates are valid from so long ago on: clocks of robots are late.
const EARLIER: Duration = Duration::days(1);
/// The authority is valid for so long, and no certificate longer.
const AUTHORITY_DAYS: u32 = 3650;

/// What to make.
pub struct KeysConfig<'a> {
    pub out: &'a Path,
    /// How cells reach the learner's machine: host names or addresses. May be empty where the folder has an authority.
    pub learner: &'a [String],
    pub cells: &'a [String],
    /// How long the certificates are valid.
    pub days: u32,
}

/// Why there are no keys, or none that can be used.
#[derive(Debug, Error)]
pub enum KeysError {
    #[error("{path}: {cause}")]
    Io { path: PathBuf, cause: io::Error },
    #[error("{0} is there already: nothing is overwritten; remove it, or choose another folder")]
    Exists(PathBuf),
    #[error("{0} has no authority: name the learner's machine with --learner to make one")]
    NoAuthority(PathBuf),
    #[error(transparent)]
    Cell(#[from] CellError),
    #[error("learner '{0}' is no host name or address")]
    Host(String),
    #[error("validity of {0} days: use 1 to {AUTHORITY_DAYS}")]
    Days(u32),
    #[error("a certificate cannot be made")]
    Make(#[from] rcgen::Error),
    #[error("{path} is not a certificate: {reason}; make one with `skillet bridge keys`")]
    Unreadable { path: PathBuf, reason: String },
    #[error(
        "{path} is valid from {from} to {to}, but this machine's clock is outside that period: set \
         the clock, or make a new certificate"
    )]
    Dates { path: PathBuf, from: String, to: String },
}

/// Makes an authority where there is none, and a certificate for each machine that is named. The folders made.
///
/// # Errors
/// [`KeysError`]; of the machines before the one it is about, the folders are there and good.
pub fn make(config: &KeysConfig) -> Result<Vec<PathBuf>, KeysError> {
    let KeysConfig { out, learner, cells, days } = *config;
    if days == 0 || days > AUTHORITY_DAYS {
        return Err(KeysError::Days(days));
    }
    let names = cells.iter().map(|name| Cell::new(name).map(|cell| cell.name().to_string()));
    let names = names.collect::<Result<Vec<String>, _>>()?;
    let hosts = learner.iter().map(|name| host(name)).collect::<Result<Vec<SanType>, _>>()?;
    let mut folders: Vec<PathBuf> = names.iter().map(|name| out.join(CELLS).join(name)).collect();
    if !hosts.is_empty() {
        folders.insert(0, out.join(LEARNER));
    }
    if let Some(there) = folders.iter().find(|folder| folder.exists()) {
        return Err(KeysError::Exists(there.clone()));
    }
    create_folder(out)?;
    let (issuer, authority) = match read_authority(out)? {
        Some(authority) => authority,
        None if hosts.is_empty() => return Err(KeysError::NoAuthority(out.to_path_buf())),
        None => make_authority(out)?,
    };
    let mut machines = Vec::new();
    if !hosts.is_empty() {
        machines.push((LEARNER.to_string(), hosts, ExtendedKeyUsagePurpose::ServerAuth));
    }
    let of_cell = |name| (name, Vec::new(), ExtendedKeyUsagePurpose::ClientAuth);
    machines.extend(names.into_iter().map(of_cell));
    for (folder, (name, hosts, usage)) in folders.iter().zip(machines) {
        let mut params = dated(days);
        params.distinguished_name.push(DnType::CommonName, name);
        params.subject_alt_names = hosts;
        params.use_authority_key_identifier_extension = true;
        params.key_usages.push(KeyUsagePurpose::DigitalSignature);
        params.extended_key_usages.push(usage);
        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &issuer)?;
        create_folder(folder)?;
        write(&folder.join(AUTHORITY), &authority)?;
        write(&folder.join(KEY), &key.serialize_pem())?;
        write(&folder.join(CERTIFICATE), &certificate.pem())?;
    }
    Ok(folders)
}

/// The common name in a certificate that is valid now.
pub(crate) fn read_owner(path: &Path) -> Result<String, KeysError> {
    let bytes = fs::read(path).map_err(|cause| KeysError::Io { path: path.into(), cause })?;
    let unreadable = |reason: String| KeysError::Unreadable { path: path.into(), reason };
    let (_, pem) = parse_x509_pem(&bytes).map_err(|error| unreadable(error.to_string()))?;
    let certificate = pem.parse_x509().map_err(|error| unreadable(error.to_string()))?;
    let validity = certificate.validity();
    if !validity.is_valid() {
        let (from, to) = (validity.not_before.to_string(), validity.not_after.to_string());
        return Err(KeysError::Dates { path: path.into(), from, to });
    }
    let mut names = certificate.subject().iter_common_name();
    let name = names.next().and_then(|name| name.as_str().ok());
    name.map(str::to_string).ok_or_else(|| unreadable("it names nobody".to_string()))
}

fn dated(days: u32) -> CertificateParams {
    let now = OffsetDateTime::now_utc();
    let mut params = CertificateParams::default();
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.not_before = now - EARLIER;
    params.not_after = now + Duration::days(days.into());
    params
}

type Authority = (Issuer<'static, KeyPair>, String);

fn make_authority(out: &Path) -> Result<Authority, KeysError> {
    let mut params = dated(AUTHORITY_DAYS);
    params.distinguished_name.push(DnType::CommonName, "skillet bridge");
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages.push(KeyUsagePurpose::KeyCertSign);
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?.pem();
    write(&out.join(AUTHORITY_KEY), &key.serialize_pem())?;
    write(&out.join(AUTHORITY), &certificate)?;
    Ok((Issuer::new(params, key), certificate))
}

/// That of an earlier call, to which cells are added.
fn read_authority(out: &Path) -> Result<Option<Authority>, KeysError> {
    let read = |name: &str| {
        let path = out.join(name);
        match fs::read_to_string(&path) {
            Ok(text) => Ok(Some(text)),
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(cause) => Err(KeysError::Io { path, cause }),
        }
    };
    let (Some(certificate), Some(key)) = (read(AUTHORITY)?, read(AUTHORITY_KEY)?) else {
        return Ok(None);
    };
    let issuer = Issuer::from_ca_cert_pem(&certificate, KeyPair::from_pem(&key)?)?;
    Ok(Some((issuer, certificate)))
}

fn host(name: &str) -> Result<SanType, KeysError> {
    if let Ok(address) = name.parse::<IpAddr>() {
        return Ok(SanType::IpAddress(address));
    }
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    let wrong = || KeysError::Host(name.to_string());
    if name.is_empty() || !name.chars().all(allowed) {
        return Err(wrong());
    }
    Ok(SanType::DnsName(name.try_into().map_err(|_| wrong())?))
}

fn create_folder(path: &Path) -> Result<(), KeysError> {
    let created = DirBuilder::new().recursive(true).mode(0o700).create(path);
    created.map_err(|cause| KeysError::Io { path: path.into(), cause })
}

/// Writes a file that only this user reads.
fn write(path: &Path, text: &str) -> Result<(), KeysError> {
    let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
    match file.and_then(|mut file| file.write_all(text.as_bytes())) {
        Ok(()) => Ok(()),
        Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {
            Err(KeysError::Exists(path.into()))
        }
        Err(cause) => Err(KeysError::Io { path: path.into(), cause }),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn make_in(out: &Path, learner: &[&str], cells: &[&str]) -> Result<Vec<PathBuf>, KeysError> {
        let owned = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
        let (learner, cells) = (owned(learner), owned(cells));
        make(&KeysConfig { out, learner: &learner, cells: &cells, days: 30 })
    }

    #[test]
    fn a_key_is_its_owners_alone_and_nothing_is_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("keys");
        let folders = make_in(&out, &["oven", "127.0.0.1"], &["kitchen", "lab"]).unwrap();
        assert_eq!(folders.len(), 3);
        for folder in &folders {
            for file in [AUTHORITY, CERTIFICATE, KEY] {
                let mode = fs::metadata(folder.join(file)).unwrap().permissions().mode();
                assert_eq!(mode & 0o777, 0o600, "{}", folder.join(file).display());
            }
        }
        assert_eq!(read_owner(&out.join("cells/lab/cert.pem")).unwrap(), "lab");
        assert_eq!(read_owner(&out.join("learner/cert.pem")).unwrap(), "learner");
        assert!(matches!(make_in(&out, &[], &["lab"]), Err(KeysError::Exists(_))));
    }

    #[test]
    fn cells_are_added_to_an_authority_that_is_there() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        assert!(matches!(make_in(out, &[], &["lab"]), Err(KeysError::NoAuthority(_))));
        make_in(out, &["oven"], &["kitchen"]).unwrap();
        let before = fs::read(out.join(AUTHORITY)).unwrap();
        make_in(out, &[], &["lab"]).unwrap();
        assert_eq!(fs::read(out.join("cells/lab/ca.pem")).unwrap(), before);
    }

    #[test]
    fn names_that_cannot_be_are_refused_before_anything_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("keys");
        assert!(matches!(make_in(&out, &["oven"], &["../x"]), Err(KeysError::Cell(_))));
        assert!(matches!(make_in(&out, &["o ven"], &["lab"]), Err(KeysError::Host(_))));
        assert!(!out.exists());
    }
}
