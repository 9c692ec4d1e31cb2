//! Addresses in the configuration files of centres and sensors.

#[cfg(feature = "mqtt")]
use fewbits_link::mqtt::rumqttc::v5::MqttOptions;
#[cfg(feature = "zenoh")]
use fewbits_link::zenoh::zenoh::{Config, Session, Wait};

/// Port of the application on which sensors behind a LoRaWAN server send, unless another is given.
#[cfg(feature = "mqtt")]
const LORAWAN_PORT: u8 = 10;

/// `host:port`, `chirpstack://[user:password@]host[:port]/application[/port]`, `ttn://` the same, `mqtt://[user:password@]host[:port]/fleet` or `zenoh://host:port/fleet`.
pub(crate) enum Place<'a> {
    Udp(&'a str),
    #[cfg(feature = "mqtt")]
    Mqtt {
        broker: &'a str,
        fleet: &'a str,
    },
    /// Devices of a LoRaWAN network server.
    #[cfg(feature = "mqtt")]
    Lorawan {
        broker: &'a str,
        server: fewbits_link::doors::lorawan::Server,
        port: u8,
    },
    #[cfg(feature = "zenoh")]
    Zenoh {
        endpoint: &'a str,
        fleet: &'a str,
    },
}

impl<'a> Place<'a> {
    pub(crate) fn of(text: &'a str) -> Result<Self, String> {
        let Some((kind, rest)) = text.split_once("://") else {
            return host_and_port(text).map(Self::Udp);
        };
        match (kind, rest.split_once('/')) {
            #[cfg(feature = "mqtt")]
            ("mqtt", Some((broker, fleet))) => Ok(Self::Mqtt { broker, fleet }),
            #[cfg(feature = "mqtt")]
            ("chirpstack" | "ttn", Some((broker, application))) => {
                use fewbits_link::doors::lorawan::Server;
                // A port of the application may follow.
                let (application, port) = match application.rsplit_once('/').map(|(rest, port)| (rest, port.parse())) {
                    Some((rest, Ok(port))) => (rest, port),
                    _ => (application, LORAWAN_PORT),
                };
                let application = application.to_owned();
                let server = match kind {
                    "ttn" => Server::TheThings(application),
                    _ => Server::ChirpStack(application),
                };
                Ok(Self::Lorawan { broker, server, port })
            }
            #[cfg(feature = "zenoh")]
            ("zenoh", Some((endpoint, fleet))) => Ok(Self::Zenoh { endpoint, fleet }),
            #[cfg(not(feature = "mqtt"))]
            ("mqtt" | "chirpstack" | "ttn", _) => {
                Err(format!("{}: this program was built without it: build it with `--features mqtt`", shown(text)))
            }
            #[cfg(not(feature = "zenoh"))]
            ("zenoh", _) => {
                Err(format!("{}: this program was built without it: build it with `--features zenoh`", shown(text)))
            }
            _ => {
                let expected = "host:port, mqtt://host:port/fleet or zenoh://host:port/fleet";
                Err(format!("{}: expected {expected}", shown(text)))
            }
        }
    }
}

/// # Errors
/// If the text is no host with a port. Whether the host exists is not looked up.
fn host_and_port(text: &str) -> Result<&str, String> {
    let is_host = |host: &str| match host.strip_prefix('[') {
        Some(rest) => rest
            .strip_suffix(']')
            .is_some_and(|ip| ip.parse::<std::net::Ipv6Addr>().is_ok()),
        None => !host.is_empty() && !host.contains([':', '/', '@']) && !host.contains(char::is_whitespace),
    };
    let parts = text.rsplit_once(':');
    match parts.is_some_and(|(host, port)| is_host(host) && port.parse::<u16>().is_ok()) {
        true => Ok(text),
        false => Err(format!(
            "`{}`: expected host:port, an IPv6 address in brackets, the port at most 65535",
            shown(text)
        )),
    }
}

/// Broker and name of the fleet of Home Assistant in `mqtt://[user:password@]host[:port]/fleet`.
pub(crate) fn home_assistant(text: &str) -> Result<(&str, &str), String> {
    let parts = text.strip_prefix("mqtt://").and_then(|rest| rest.split_once('/'));
    match parts.filter(|(broker, fleet)| !(broker.is_empty() || fleet.is_empty())) {
        Some(_) if cfg!(not(feature = "mqtt")) => Err(format!("home_assistant: {NO_MQTT}")),
        Some(parts) => Ok(parts),
        None => {
            let expected = "mqtt://[user:password@]host[:port]/fleet";
            Err(format!("home_assistant is {}: expected {expected}", shown(text)))
        }
    }
}

pub(crate) const NO_MQTT: &str = "this program was built without MQTT: build it with `--features mqtt`";

/// The text without user and password, for messages: what stands before the last `@` is left out.
pub(crate) fn shown(text: &str) -> String {
    let (kind, rest) = text.split_once("://").map_or(("", text), |(kind, rest)| (kind, rest));
    // An application of The Things Stack has an `@` of its own.
    let application = if kind == "ttn" {
        rest.rfind('/').unwrap_or(rest.len())
    } else {
        rest.len()
    };
    let rest = match rest[..application].rfind('@') {
        Some(at) => &rest[at + 1..],
        None => rest,
    };
    match kind {
        "" => rest.to_owned(),
        kind => format!("{kind}://{rest}"),
    }
}

/// Options for a broker given as `[user:password@]host[:port]`.
#[cfg(feature = "mqtt")]
pub(crate) fn mqtt(broker: &str) -> Result<MqttOptions, String> {
    let (login, address) = match broker.rsplit_once('@') {
        Some((login, address)) => (Some(login), address),
        None => (None, broker),
    };
    // The colons of an IPv6 address are in brackets.
    let (host, port) = match address.rsplit_once(':').filter(|(_, port)| !port.ends_with(']')) {
        Some((host, port)) => (host, port.parse().map_err(|_| format!("broker {address}: no port"))?),
        None => (address, 1883),
    };
    // With an empty name the broker assigns a unique one.
    let mut options = MqttOptions::new("", host.trim_matches(['[', ']']), port);
    if let Some((user, password)) = login.map(|login| login.split_once(':').unwrap_or((login, ""))) {
        options.set_credentials(user, password);
    }
    Ok(options)
}

/// A session that listens at `endpoint` (`host:port`), or connects to it as soon as it is listened at.
#[cfg(feature = "zenoh")]
pub(crate) fn zenoh(endpoint: &str, listens: bool) -> Result<Session, Box<dyn std::error::Error>> {
    let endpoint = format!("[{:?}]", format!("tcp/{endpoint}"));
    let (listen, connect) = if listens {
        (&*endpoint, "[]")
    } else {
        ("[]", &*endpoint)
    };
    let mut config = Config::default();
    let settings = [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("listen/endpoints", listen),
        ("connect/endpoints", connect),
    ];
    for (name, value) in settings {
        config.insert_json5(name, value).map_err(|error| error.to_string())?;
    }
    Ok(fewbits_link::zenoh::zenoh::open(config)
        .wait()
        .map_err(|error| error.to_string())?)
}
