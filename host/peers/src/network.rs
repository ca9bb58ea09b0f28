//! The ways to other rigs: which addresses are connected to, and which are listened on.

use std::net::IpAddr;

use serde_json::json;

use crate::error::PeersError;

/// A link on which nothing was heard for this long is cut, in milliseconds.
const LEASE_MS: u64 = 4000;

/// Addresses of peers, such as `tcp/192.168.1.20:7447`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Network {
    connect: Vec<String>,
    listen: Vec<String>,
}

impl Network {
    /// Connects to each address of `connect`, again and again until it answers, and listens on those of `listen`. Those let other computers in
    /// only where `open`.
    ///
    /// # Errors
    /// [`PeersError::Endpoint`], [`PeersError::OtherComputers`], [`PeersError::Nowhere`]
    pub fn new(connect: &[String], listen: &[String], open: bool) -> Result<Self, PeersError> {
        for endpoint in connect.iter().chain(listen) {
            host(endpoint).ok_or_else(|| PeersError::Endpoint(endpoint.clone()))?;
        }
        if let Some(endpoint) = listen.iter().find(|endpoint| !open && !host(endpoint).is_some_and(is_loopback)) {
            return Err(PeersError::OtherComputers(endpoint.clone()));
        }
        if connect.is_empty() && listen.is_empty() {
            return Err(PeersError::Nowhere);
        }
        Ok(Self { connect: connect.to_vec(), listen: listen.to_vec() })
    }

    /// The settings of zenoh: no search by multicast, no introduction by others, no address that nobody named.
    #[must_use]
    pub fn settings(&self) -> String {
        let settings = json!({
            "mode": "peer",
            "connect": {
                "endpoints": self.connect,
                "timeout_ms": -1,
                "exit_on_failure": false,
                "retry": { "period_init_ms": 250, "period_max_ms": 1000, "period_increase_factor": 2 },
            },
            "listen": { "endpoints": self.listen, "timeout_ms": 0, "exit_on_failure": true },
            "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
            "transport": { "link": { "tx": { "lease": LEASE_MS } } },
        });
        settings.to_string()
    }
}

/// The host of `tcp/HOST:PORT`.
fn host(endpoint: &str) -> Option<&str> {
    let (host, port) = endpoint.strip_prefix("tcp/")?.rsplit_once(':')?;
    // What follows '#' or '?' would be options of the link.
    let is_plain = !host.is_empty() && !endpoint.contains(['#', '?', ' ']);
    (is_plain && port.parse::<u16>().is_ok()).then_some(host)
}

fn is_loopback(host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(connect: &[&str], listen: &[&str], open: bool) -> Result<Network, PeersError> {
        let owned = |all: &[&str]| all.iter().map(|&endpoint| endpoint.to_owned()).collect::<Vec<_>>();
        Network::new(&owned(connect), &owned(listen), open)
    }

    #[test]
    fn other_computers_get_in_by_a_flag_only() {
        for near in ["tcp/127.0.0.1:0", "tcp/localhost:7447", "tcp/[::1]:7447"] {
            assert!(network(&[], &[near], false).is_ok(), "{near}");
        }
        for far in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.1.20:7447", "tcp/rig.local:7447"] {
            assert_eq!(network(&[], &[far], false), Err(PeersError::OtherComputers(far.to_owned())));
            assert!(network(&[], &[far], true).is_ok() && network(&[far], &[], false).is_ok(), "{far}");
        }
    }

    #[test]
    fn what_is_no_address_is_refused() {
        for wrong in
            ["", "127.0.0.1:7447", "udp/127.0.0.1:7447", "tcp/:7447", "tcp/host", "tcp/host:x", "tcp/a:1#iface=b"]
        {
            assert_eq!(network(&[wrong], &[], true), Err(PeersError::Endpoint(wrong.to_owned())));
        }
        assert_eq!(network(&[], &[], true), Err(PeersError::Nowhere));
    }

    #[test]
    fn nothing_is_listened_on_that_nobody_named() {
        let settings = network(&["tcp/10.0.0.2:7447"], &[], false).expect("a network").settings();
        let settings: serde_json::Value = serde_json::from_str(&settings).expect("JSON");
        assert_eq!(settings["listen"]["endpoints"], json!([]));
        assert_eq!(settings["scouting"], json!({ "multicast": { "enabled": false }, "gossip": { "enabled": false } }));
    }
}
