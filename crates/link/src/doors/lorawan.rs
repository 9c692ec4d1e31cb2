//! Messages of LoRaWAN network servers over MQTT: uplinks of ChirpStack (versions 3 and 4) and of The Things Stack (versions 2 and 3) in, and
//! downlinks out.
//!
//! Sources: the integration events of ChirpStack (`UplinkEvent`, `DownlinkCommand`) and the data formats of The Things Stack
//! (`ApplicationUp`, `DownlinkQueueRequest`), as JSON.

use super::home_assistant::Message;
use crate::base64;
use crate::error::Error;
use fewbits_numerics::error::refuse;
use serde_json::{Value, json};

/// What a device has sent.
#[derive(Debug, Clone, PartialEq)]
pub struct Uplink {
    /// The device's EUI in small hexadecimal digits (ChirpStack), or its name (The Things Stack).
    pub device: String,
    /// Port of the application.
    pub port: u8,
    /// LoRaWAN's counter of the frame. Servers leave it out if it is zero.
    pub counter: u64,
    /// The application's bytes.
    pub payload: Vec<u8>,
    /// When the server received it, as it says: a date of RFC 3339. Empty if it says none.
    pub time: String,
}

/// The uplink in a message; `None` if the message is another event (a join, a status), or an uplink without application bytes.
///
/// # Errors
/// If the text is not JSON, or an uplink has bytes that are not base64 or a port that is not one.
pub fn uplink(message: &str) -> Result<Option<Uplink>, Error> {
    let Ok(mut message) = serde_json::from_str::<Value>(message) else {
        return refuse("uplink", "no JSON", "the JSON of ChirpStack or The Things Stack");
    };
    // What The Things Stack has stored, and its stream of events, wrap each message.
    for wrap in ["result", "data"] {
        if message
            .get(wrap)
            .is_some_and(|inner| inner.get("uplink_message").is_some())
        {
            message = message[wrap].take();
        }
    }
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    // Where each server's format has device, port, counter, bytes and time.
    let found = if let Some(info) = message.get("deviceInfo") {
        let data = message.get("data").or_else(|| message.get("frmPayload"));
        Some((text(&info["devEui"]), &message["fPort"], &message["fCnt"], data, &message["time"]))
    } else if let Some(eui) = message.get("devEUI") {
        let time = message.get("publishedAt").unwrap_or(&message["rxInfo"][0]["time"]);
        Some((eui_of(eui), &message["fPort"], &message["fCnt"], message.get("data"), time))
    } else if let Some(up) = message.get("uplink_message") {
        let time = up.get("received_at").unwrap_or(&message["received_at"]);
        let ids = &message["end_device_ids"];
        let device = text(ids.get("device_id").unwrap_or(&ids["dev_eui"]));
        Some((device, &up["f_port"], &up["f_cnt"], up.get("frm_payload"), time))
    } else if message.get("payload_raw").is_some() {
        let (device, data) = (text(&message["dev_id"]), message.get("payload_raw"));
        Some((device, &message["port"], &message["counter"], data, &message["metadata"]["time"]))
    } else {
        None
    };
    let Some((device, port, counter, Some(data), time)) = found else {
        return Ok(None);
    };
    let data = data.as_str().unwrap_or_default();
    if data.is_empty() {
        return Ok(None);
    }
    let Some(payload) = base64::decode(data) else {
        return refuse("payload of an uplink", data.chars().take(40).collect::<String>(), "base64");
    };
    let Ok(port) = u8::try_from(port.as_u64().unwrap_or(0)) else {
        return refuse("port of an uplink", port, "0 to 255");
    };
    if device.is_empty() {
        return refuse("device of an uplink", "none", "its EUI or name");
    }
    Ok(Some(Uplink {
        device: device.to_ascii_lowercase(),
        port,
        counter: counter.as_u64().unwrap_or(0),
        payload,
        time: time.as_str().unwrap_or_default().to_owned(),
    }))
}

/// Version 3 of ChirpStack writes the EUI in base64 or in hexadecimal digits, as it is set up.
fn eui_of(eui: &Value) -> String {
    let text = eui.as_str().unwrap_or_default();
    if text.len() == 16 && text.chars().all(|c| c.is_ascii_hexdigit()) {
        return text.to_owned();
    }
    let bytes = base64::decode(text).unwrap_or_default();
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A network server and the application of it whose devices are sensors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Server {
    /// ChirpStack 4; the application's identity, as `17c82e96-be03-4f38-aef3-f83d48582d97`.
    ChirpStack(String),
    /// The Things Stack 3; the application with its tenant, as `plant@ttn`.
    TheThings(String),
}

impl Server {
    /// The topics of uplinks, with a wildcard for the device.
    pub fn uplinks(&self) -> String {
        match self {
            Self::ChirpStack(application) => format!("application/{application}/device/+/event/up"),
            Self::TheThings(application) => format!("v3/{application}/devices/+/up"),
        }
    }

    /// The message that sends these bytes to a device. It replaces what waits for the device at The Things Stack: a question whose slot is
    /// over is not sent.
    pub fn downlink(&self, device: &str, port: u8, payload: &[u8]) -> Message {
        let data = base64::encode(payload);
        let (topic, content) = match self {
            Self::ChirpStack(application) => (
                format!("application/{application}/device/{device}/command/down"),
                json!({ "devEui": device, "confirmed": false, "fPort": port, "data": data }),
            ),
            Self::TheThings(application) => (
                format!("v3/{application}/devices/{device}/down/replace"),
                json!({ "downlinks": [{ "f_port": port, "frm_payload": data, "priority": "NORMAL" }] }),
            ),
        };
        Message {
            topic,
            content: content.to_string(),
            retained: false,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Messages with the fields of the servers' documentation, around the bytes of the published example of Cayenne LPP.
    #[test]
    fn uplinks_of_each_server_are_read() {
        let payload = base64::encode(&[0x03, 0x67, 0x01, 0x10, 0x05, 0x67, 0x00, 0xff]);
        let rx = json!([{ "gatewayId": "0016c001f153a14c", "rssi": -48, "time": "2026-03-01T12:00:01Z" }]);
        let messages = [
            json!({ "deduplicationId": "3ac7e3c4", "time": "2026-03-01T12:00:00Z", "deviceInfo": { "tenantName": "ChirpStack",
                "deviceName": "hall", "devEui": "0101010101010101" }, "devAddr": "00189440", "adr": true, "dr": 5, "fCnt": 2, "fPort": 7,
                "confirmed": false, "data": payload, "rxInfo": rx }),
            json!({ "applicationID": "1", "deviceName": "hall", "devEUI": "AQEBAQEBAQE=", "fCnt": 2, "fPort": 7, "data": payload,
                "rxInfo": rx }),
            json!({ "end_device_ids": { "device_id": "hall", "application_ids": { "application_id": "app1" }, "dev_eui": "0101010101010101" },
                "received_at": "2026-03-01T12:00:00Z", "uplink_message": { "f_port": 7, "f_cnt": 2, "frm_payload": payload,
                "received_at": "2026-03-01T12:00:00Z" } }),
            json!({ "app_id": "app1", "dev_id": "hall", "hardware_serial": "0101010101010101", "port": 7, "counter": 2,
                "payload_raw": payload, "metadata": { "time": "2026-03-01T12:00:00Z" } }),
            json!({ "result": { "end_device_ids": { "device_id": "hall" }, "received_at": "2026-03-01T12:00:00Z", "uplink_message":
                { "f_port": 7, "f_cnt": 2, "frm_payload": payload } } }),
            json!({ "name": "as.up.data.forward", "time": "2026-03-01T12:00:09Z", "data": { "@type": "ApplicationUp", "end_device_ids":
                { "device_id": "hall" }, "received_at": "2026-03-01T12:00:00Z", "uplink_message": { "f_port": 7, "f_cnt": 2,
                "frm_payload": payload } } }),
        ];
        for (i, message) in messages.iter().enumerate() {
            let found = uplink(&message.to_string()).unwrap().unwrap();
            let device = if i < 2 { "0101010101010101" } else { "hall" };
            assert_eq!((found.device.as_str(), found.port, found.counter), (device, 7, 2), "{message}");
            assert!(found.time.starts_with("2026-03-01T12:00:0"), "{}", found.time);
            let readings = crate::doors::cayenne::readings(&found.payload).unwrap();
            assert_eq!((readings[0].values[0], readings[1].values[0]), (27.2, 25.5));
        }
    }

    #[test]
    fn other_events_are_none_and_bad_ones_are_refused() {
        for other in [
            json!({ "end_device_ids": { "device_id": "hall" }, "join_accept": {} }),
            json!({ "deviceInfo": { "devEui": "0101010101010101" }, "margin": 3 }),
            // The Things Stack leaves out what is empty.
            json!({ "end_device_ids": { "device_id": "hall" }, "uplink_message": { "f_cnt": 4 } }),
            json!([1, 2]),
        ] {
            assert_eq!(uplink(&other.to_string()).unwrap(), None, "{other}");
        }
        let bad = |data: &str, port: u64| {
            let message = json!({ "deviceInfo": { "devEui": "01" }, "fPort": port, "data": data });
            uplink(&message.to_string()).is_err()
        };
        assert!(bad("A", 1) && bad("AQ=A", 1) && bad("AQ==", 256) && uplink("{").is_err());
        assert!(uplink(&json!({ "deviceInfo": {}, "data": "AQ==" }).to_string()).is_err());
    }

    #[test]
    fn downlinks_hold_the_bytes() {
        let server = Server::ChirpStack("17c8".to_owned());
        let message = server.downlink("0101010101010101", 7, &[1, 2, 3, 4]);
        assert_eq!(message.topic, "application/17c8/device/0101010101010101/command/down");
        let content: Value = serde_json::from_str(&message.content).unwrap();
        assert_eq!((&content["data"], &content["fPort"]), (&json!("AQIDBA=="), &json!(7)));
        let server = Server::TheThings("plant@ttn".to_owned());
        let message = server.downlink("hall", 7, &[1, 2, 3, 4]);
        assert_eq!(
            (message.topic.as_str(), server.uplinks().as_str()),
            ("v3/plant@ttn/devices/hall/down/replace", "v3/plant@ttn/devices/+/up")
        );
        let content: Value = serde_json::from_str(&message.content).unwrap();
        assert_eq!(content["downlinks"][0]["frm_payload"], json!("AQIDBA=="));
    }
}
