//! The network: who may listen where, with which keys, and the names of what goes over it.
//!
//! Nothing is discovered: no multicast, no gossip. A hub listens where it was told to, a cell connects to where it
//! was told to.

use std::fs;
use std::net::IpAddr;
use std::path::{Path, PathBuf};

use rustix::time::{ClockId, clock_gettime};
use serde_json::{Value, json};
use thiserror::Error;
use zenoh::{Config, Session, Wait};

use crate::keys;
use crate::turn::MAX_TURN;

/// Silence after which a link counts as cut, ms.
const LEASE_MS: u64 = 3000;
/// Room for what the transport puts around a turn.
const FRAME: usize = 65_536;
/// Anybody with a certificate of the hub's authority may ask here why nobody answers elsewhere.
pub(crate) const DOOR: &str = "skillet-door";

/// Why there is no network.
#[derive(Debug, Error)]
pub enum NetError {
    #[error("address '{0}': use HOST:PORT, as in 192.168.1.10:7447")]
    Address(String),
    #[error(
        "address '{0}' can be reached from other machines: give --keys (make them with `skillet bridge keys`), or \
         listen on 127.0.0.1"
    )]
    Open(String),
    #[error("address '{address}' uses '{found}': use 'tls' with keys, 'tcp' without")]
    Protocol { address: String, found: String },
    #[error(transparent)]
    Keys(#[from] keys::KeysError),
    #[error("cell name '{0}' in the allow-list: {1}")]
    Cell(String, shm_types::cell::CellError),
    #[error("setting {setting} of the network: {reason}")]
    Setting { setting: &'static str, reason: String },
    #[error("{address}: {reason}")]
    Transport { address: String, reason: String },
}

/// A folder of `skillet bridge keys`: the authority's certificate, and a certificate with its key.
#[derive(Clone, Debug)]
pub struct Keys {
    dir: PathBuf,
}

impl Keys {
    pub fn at(dir: &Path) -> Keys {
        Keys { dir: dir.to_path_buf() }
    }

    /// The name in the certificate, after a look at its dates.
    pub fn owner(&self) -> Result<String, NetError> {
        Ok(keys::read_owner(&self.dir.join(keys::CERTIFICATE))?)
    }

    fn file(&self, name: &str) -> Value {
        json!(self.dir.join(name).to_string_lossy())
    }
}

pub(crate) fn turn_key(cell: &str) -> String {
    format!("skillet/{cell}/turn")
}

/// Where a cell shows its loop.
pub(crate) fn live_key(cell: &str) -> String {
    format!("skillet/{cell}/live")
}

pub(crate) fn alive_key(cell: &str, bridge: u64) -> String {
    format!("skillet/{cell}/alive/{bridge:016x}")
}

pub(crate) fn all_alive_key(cell: &str) -> String {
    format!("skillet/{cell}/alive/*")
}

/// Opens the hub's end at `address`, for these cells and no others.
pub(crate) fn listen(
    address: &str,
    keys: Option<&Keys>,
    cells: &[String],
) -> Result<(Session, String), NetError> {
    let endpoint = endpoint(address, keys.is_some())?;
    if keys.is_none() && !is_loopback(&endpoint) {
        return Err(NetError::Open(address.to_string()));
    }
    let mut settings = settings("peer", keys);
    settings.push(("listen/endpoints", json!([endpoint])));
    settings.push(("listen/exit_on_failure", json!(true)));
    if keys.is_some() {
        settings.push(("access_control", access(cells)));
    }
    let session = open(settings, &endpoint)?;
    Ok((session, endpoint))
}

/// Opens the end of a cell. It comes back by itself after a cut.
pub(crate) fn connect(address: &str, keys: Option<&Keys>) -> Result<Session, NetError> {
    let endpoint = endpoint(address, keys.is_some())?;
    let mut settings = settings("client", keys);
    settings.push(("listen/endpoints", json!([])));
    settings.push(("connect/endpoints", json!([endpoint])));
    settings.push(("connect/timeout_ms", json!(0)));
    settings.push(("connect/exit_on_failure", json!(true)));
    let retry =
        json!({ "period_init_ms": 200, "period_max_ms": 4000, "period_increase_factor": 2 });
    settings.push(("connect/retry", retry));
    open(settings, &endpoint)
}

fn open(settings: Vec<(&'static str, Value)>, address: &str) -> Result<Session, NetError> {
    let mut config = Config::default();
    for (setting, value) in settings {
        config
            .insert_json5(setting, &value.to_string())
            .map_err(|error| NetError::Setting { setting, reason: error.to_string() })?;
    }
    zenoh::open(config).wait().map_err(|error| {
        let whole = error.to_string();
        // Behind the reason it says where in its source.
        let reason = whole.split(" at /").next().unwrap_or(&whole).trim().to_string();
        NetError::Transport { address: address.to_string(), reason }
    })
}

fn settings(mode: &str, keys: Option<&Keys>) -> Vec<(&'static str, Value)> {
    let protocol = if keys.is_some() { "tls" } else { "tcp" };
    let mut settings = vec![
        ("mode", json!(mode)),
        ("scouting/multicast/enabled", json!(false)),
        ("scouting/gossip/enabled", json!(false)),
        ("adminspace/enabled", json!(false)),
        ("transport/link/protocols", json!([protocol])),
        ("transport/link/tx/lease", json!(LEASE_MS)),
        ("transport/link/rx/max_message_size", json!(MAX_TURN + FRAME)),
    ];
    if let Some(keys) = keys {
        settings.push(("transport/link/tls/root_ca_certificate", keys.file(keys::AUTHORITY)));
        settings.push(("transport/link/tls/enable_mtls", json!(true)));
        settings.push(("transport/link/tls/verify_name_on_connect", json!(true)));
        settings.push(("transport/link/tls/close_link_on_expiration", json!(true)));
        let (certificate, key) = match mode {
            "peer" => {
                ("transport/link/tls/listen_certificate", "transport/link/tls/listen_private_key")
            }
            _ => {
                ("transport/link/tls/connect_certificate", "transport/link/tls/connect_private_key")
            }
        };
        settings.push((certificate, keys.file(keys::CERTIFICATE)));
        settings.push((key, keys.file(keys::KEY)));
    }
    settings
}

/// A certificate of a cell speaks under the name of that cell and no other. Others may knock.
fn access(cells: &[String]) -> Value {
    let incoming = json!(["query", "liveliness_token"]);
    let outgoing =
        json!(["declare_queryable", "reply", "declare_liveliness_subscriber", "liveliness_query"]);
    let rule = |id: String, flow: &str, messages: &Value, key: String| json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": [key] });
    let both = |name: &str, key: String| {
        [
            rule(format!("{name} in"), "ingress", &incoming, key.clone()),
            rule(format!("{name} out"), "egress", &outgoing, key),
        ]
    };
    let mut rules = both("door", DOOR.to_string()).to_vec();
    let mut subjects = vec![json!({ "id": "anybody" })];
    let mut policies = vec![json!({ "rules": ["door in", "door out"], "subjects": ["anybody"] })];
    for cell in cells {
        rules.extend(both(&format!("cell {cell}"), format!("skillet/{cell}/**")));
        let (shows, watches) = (json!(["put"]), json!(["declare_subscriber"]));
        rules.push(rule(format!("live {cell} in"), "ingress", &shows, live_key(cell)));
        rules.push(rule(format!("live {cell} out"), "egress", &watches, live_key(cell)));
        subjects.push(json!({ "id": format!("cell {cell}"), "cert_common_names": [cell] }));
        policies.push(json!({
            "rules": [
                format!("cell {cell} in"), format!("cell {cell} out"),
                format!("live {cell} in"), format!("live {cell} out"),
            ],
            "subjects": [format!("cell {cell}")],
        }));
    }
    json!({
        "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    })
}

/// `HOST:PORT`, or with the protocol before it.
fn endpoint(address: &str, has_keys: bool) -> Result<String, NetError> {
    let expected = if has_keys { "tls" } else { "tcp" };
    let (protocol, place) = address.split_once('/').unwrap_or((expected, address));
    if protocol != expected {
        let (address, found) = (address.to_string(), protocol.to_string());
        return Err(NetError::Protocol { address, found });
    }
    let is_place = place.rsplit_once(':').is_some_and(|(host, port)| {
        let is_host = |c: char| c.is_ascii_alphanumeric() || ".-_:[]".contains(c);
        !host.is_empty() && host.chars().all(is_host) && port.parse::<u16>().is_ok()
    });
    if is_place {
        Ok(format!("{protocol}/{place}"))
    } else {
        Err(NetError::Address(address.to_string()))
    }
}

fn is_loopback(endpoint: &str) -> bool {
    let place = endpoint.split_once('/').map_or(endpoint, |(_, place)| place);
    let host = place.rsplit_once(':').map_or(place, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// The clock that controllers of this machine name ticks by, ns.
pub(crate) fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// The name of this machine, as it tells it.
pub fn host_name() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    match name.trim() {
        "" => "an unnamed machine".to_string(),
        name => name.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_keys_only_this_machine_is_listened_to() {
        for open in ["0.0.0.0:7447", "[::]:7447", "192.168.1.4:7447", "tcp/oven:7447"] {
            assert!(matches!(listen(open, None, &[]), Err(NetError::Open(_))), "{open}");
        }
        for own in ["tcp/127.0.0.1:1", "tcp/[::1]:1", "tcp/localhost:1"] {
            assert!(is_loopback(own), "{own}");
        }
    }

    #[test]
    fn an_address_is_host_and_port() {
        assert_eq!(endpoint("oven:7447", true).unwrap(), "tls/oven:7447");
        assert_eq!(endpoint("tls/oven:7447", true).unwrap(), "tls/oven:7447");
        assert!(matches!(endpoint("tcp/oven:7447", true), Err(NetError::Protocol { .. })));
        for wrong in ["oven", "oven:", ":7447", "oven:70000", "oven:1#so_sndbuf=1", "a b:1"] {
            assert!(matches!(endpoint(wrong, true), Err(NetError::Address(_))), "{wrong}");
        }
    }
}
